"""What a log holds, once its conventions have been resolved."""

from collections import Counter
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from gridwright_client.se2 import Poses

FRONT = "front"
REAR = "rear"
"""The lasers' names, in parameters too: `robot_frontlaser_offset`, `robot_rear_laser_max`."""


@dataclass(frozen=True)
class BeamGeometry:
    """Where the beams of a sweep point, in the laser's frame."""

    first_bearing_rad: float
    increment_rad: float
    beams: int

    def bearings_rad(self) -> NDArray[np.float64]:
        """The bearing of each beam, shape (beams,)."""
        return self.first_bearing_rad + self.increment_rad * np.arange(self.beams, dtype=np.float64)


@dataclass(frozen=True, slots=True)
class OdometryReading:
    """Dead reckoning alone (ODOM)."""

    line_number: int
    stamp_ns: int
    odom_from_base: Poses
    """shape (3,)"""


@dataclass(frozen=True, slots=True)
class LaserReading:
    """One sweep of one laser."""

    line_number: int
    stamp_ns: int
    sensor_id: str
    geometry: BeamGeometry
    ranges_m: NDArray[np.float32]
    """shape (beams,); +Inf = nothing within reach, NaN = erroneous (REP-117)."""
    range_max_m: float
    """Ranges from here on mean no return."""
    odom_from_base: Poses | None
    """shape (3,); None where the message does not carry odometry (RAWLASER1)."""


@dataclass(frozen=True, slots=True)
class TruePoseReading:
    """What a simulator knew (TRUEPOS)."""

    line_number: int
    stamp_ns: int
    map_from_base: Poses
    """shape (3,)"""


Reading = OdometryReading | LaserReading | TruePoseReading


@dataclass(frozen=True)
class MalformedLine:
    """A line that could not be used, and why."""

    line_number: int
    reason: str


@dataclass
class CarmenLog:
    """A log's readings in the order of the file, which is the order of events.

    Stamps may go back by milliseconds: the messages of a robot's processes were logged as they came.
    """

    readings: list[Reading] = field(default_factory=list)
    base_from_laser: dict[str, Poses] = field(default_factory=dict)
    """Where each laser that has a sweep in the log is mounted, shape (3,); in order of appearance."""
    parameters: dict[str, str] = field(default_factory=dict)
    malformed: list[MalformedLine] = field(default_factory=list)
    messages: Counter[str] = field(default_factory=Counter)
    """How many well-formed lines there are of each message that is read."""
    ignored: Counter[str] = field(default_factory=Counter)
    """How many lines there are of each message that is not read."""

    @property
    def scans(self) -> list[LaserReading]:
        """The sweeps of all lasers."""
        return [reading for reading in self.readings if isinstance(reading, LaserReading)]
