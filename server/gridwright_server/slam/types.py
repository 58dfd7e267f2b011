"""What goes into the mapper and what comes out.

Poses are float64 arrays (x_m, y_m, theta_rad); `a_from_b` is the pose of frame b in frame a.
Times are integer nanoseconds, for float64 seconds since 1970 cannot tell microseconds apart.
"""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from enum import Enum, auto
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

Pose = NDArray[np.float64]
"""shape (3,): x in m, y in m, theta in rad."""


class Verdict(Enum):
    """What became of a sensor item; names as in gridwright.v1.Verdict."""

    PROCESSED = auto()
    SKIPPED_BELOW_MOTION_THRESHOLD = auto()
    DUPLICATE = auto()
    REJECTED_OUT_OF_ORDER = auto()
    REJECTED_INVALID = auto()
    REJECTED_NO_ODOMETRY = auto()
    REJECTED_OUTSIDE_MAP = auto()


@dataclass(frozen=True)
class Scan:
    """One sweep of a laser, in the laser's frame."""

    stamp_ns: int
    """When the first ray was fired."""
    bearings_rad: NDArray[np.float64]
    """shape (beams,)"""
    ranges_m: NDArray[np.float64]
    """shape (beams,); what is not in [range_min_m, range_max_m) or not finite is no return (REP-117)."""
    range_min_m: float
    range_max_m: float
    base_from_laser: Pose
    """Where the laser is mounted."""


@dataclass(frozen=True)
class PoseEstimate:
    """The robot's pose as the best particle has it."""

    stamp_ns: int
    map_from_base: Pose
    covariance: NDArray[np.float64]
    """shape (3, 3), in m^2, m rad, rad^2, axes of the map frame; over all particles."""
    map_from_odom: Pose
    effective_sample_size: float
    particle_count: int


@dataclass(frozen=True)
class ScanResult:
    """What became of a scan; `estimate` is None where it was rejected."""

    verdict: Verdict
    estimate: PoseEstimate | None = None


@dataclass(frozen=True)
class Trajectory:
    """The best particle's path: a pose for every scan that was not rejected, in order of arrival."""

    stamps_ns: NDArray[np.int64]
    """shape (n,)"""
    map_from_base: NDArray[np.float64]
    """shape (n, 3)"""
    processed: NDArray[np.bool_]
    """shape (n,); False where the motion filter skipped the scan and its pose is interpolated."""


class MapSnapshot(Protocol):
    """The best particle's map at one moment; unchanged by later scans, readable from any thread.

    Holds tiles that the filter would otherwise reuse: close it when done.
    """

    stamp_ns: int
    revision: int
    """Grows with each scan that updated the map."""
    generation: int
    """Grows when another particle became the best."""
    resolution_m: float
    tile_cells: int
    """Cells along the side of a tile."""
    tile_origins: NDArray[np.int32]
    """shape (tiles, 2): column and row of each tile's first cell; sorted by row, then column."""

    def occupancy(self, tile: int) -> NDArray[np.int8]:
        """shape (tile_cells, tile_cells), [row, column]: -1 unknown, 0..100 probability in percent."""
        ...

    def close(self) -> None:
        """Gives the tiles back; calling it twice is harmless."""
        ...


class Workers(Protocol):
    """Runs independent pieces of work; concurrent.futures.Executor is one."""

    def map(self, fn: Callable[..., Any], *iterables: Iterable[Any]) -> Iterator[Any]:
        """As Executor.map."""
        ...
