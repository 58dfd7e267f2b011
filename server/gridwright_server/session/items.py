"""What goes through a session's queue."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Protocol, Self

from gridwright_server.config import MapperConfig
from gridwright_server.errors import FieldViolation, GridwrightError
from gridwright_server.slam.types import (
    MapSnapshot,
    Pose,
    PoseEstimate,
    Scan,
    ScanResult,
    Trajectory,
    Verdict,
)


class MapperPort(Protocol):
    """What a session needs of slam.mapper.Mapper."""

    def add_odometry(self, stamp_ns: int, odom_from_base: Pose) -> Verdict:
        """As Mapper.add_odometry."""
        ...

    def add_scan(self, scan: Scan) -> ScanResult:
        """As Mapper.add_scan."""
        ...

    def trajectory(self) -> Trajectory:
        """As Mapper.trajectory."""
        ...

    def map_snapshot(self) -> MapSnapshot | None:
        """As Mapper.map_snapshot."""
        ...


@dataclass(frozen=True)
class SessionSpec:
    """What a session is created with."""

    session_id: str
    create_time_ns: int
    config: MapperConfig
    seed: int
    base_from_laser: Mapping[str, Pose]
    """Mounting of each laser by its sensor id, in the order of declaration."""


@dataclass(frozen=True)
class OdometryReading:
    """Where dead reckoning believes the robot to be."""

    stamp_ns: int
    odom_from_base: Pose


@dataclass(frozen=True)
class InvalidData:
    """An item that breaks the rules of its message; it is answered and otherwise ignored."""

    violations: tuple[FieldViolation, ...]


class Duplicate:
    """An item whose sequence number was seen before."""


@dataclass(frozen=True)
class SensorItem:
    """One item for a session."""

    data: Scan | OdometryReading | InvalidData | Duplicate
    record: Callable[[], bytes] | None
    """Gives the item as the journal keeps it; None = not worth keeping."""
    sequence_number: int | None = None
    """None for items that came outside a stream."""


@dataclass(frozen=True)
class Outcome:
    """What became of one item."""

    verdict: Verdict
    sequence_number: int | None = None
    violations: tuple[FieldViolation, ...] = ()
    estimate: PoseEstimate | None = None


Deliver = Callable[[Outcome | GridwrightError], None]
"""Called once for every item, by the session's writer thread: must not block."""


@dataclass(frozen=True)
class SessionCounts:
    """How many items met with which verdict; names as in gridwright.v1.SessionCounts."""

    odometry_processed: int = 0
    scans_processed: int = 0
    scans_skipped_below_motion_threshold: int = 0
    duplicates: int = 0
    rejected_out_of_order: int = 0
    rejected_invalid: int = 0
    rejected_no_odometry: int = 0
    rejected_outside_map: int = 0

    def with_one_more(self, verdict: Verdict, data: object) -> Self:
        """Counts one item in."""
        if verdict is Verdict.DUPLICATE:
            name = "duplicates"
        elif verdict is Verdict.PROCESSED and isinstance(data, OdometryReading):
            name = "odometry_processed"
        elif verdict in (Verdict.PROCESSED, Verdict.SKIPPED_BELOW_MOTION_THRESHOLD):
            name = f"scans_{verdict.name.lower()}"
        else:
            name = verdict.name.lower()
        return replace(self, **{name: getattr(self, name) + 1})
