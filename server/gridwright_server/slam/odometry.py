"""Odometry readings and the pose they give at a scan's time."""

from collections import deque
from itertools import islice

from gridwright_server.slam import se2
from gridwright_server.slam.types import Pose

HISTORY = 1024
"""Readings kept: ten seconds of a fast robot's odometry, far more than a scan is late."""

EXTRAPOLATION_LIMIT_NS = 250_000_000
"""How far beyond the newest reading its speed is trusted."""

SPEED_BASE_NS = 50_000_000
"""Least time between two readings to tell a speed by: those of a burst lie a millisecond apart."""


class OdometryBuffer:
    """The newest readings, in order of arrival."""

    def __init__(self) -> None:
        self._readings: deque[tuple[int, Pose]] = deque(maxlen=HISTORY)

    def __len__(self) -> int:
        return len(self._readings)

    def add(self, stamp_ns: int, odom_from_base: Pose) -> None:
        """Takes up the newest reading."""
        self._readings.append((stamp_ns, odom_from_base))

    def at(self, stamp_ns: int) -> Pose:
        """odom_from_base at a time, interpolated on SE(2) between the readings around it.

        Of several pairs of successive readings around that time (clocks that step back make some)
        the newest counts. Beyond all readings the robot is taken to go on at its speed before the newest,
        for at most EXTRAPOLATION_LIMIT_NS; before all, to have stood at the oldest.
        """
        newest = newer = self._readings[-1]
        for older in islice(reversed(self._readings), 1, None):
            if min(older[0], newer[0]) <= stamp_ns <= max(older[0], newer[0]):
                return _on_the_way(older, newer, stamp_ns)
            if stamp_ns > newest[0] and older[0] <= newest[0] - SPEED_BASE_NS:
                return _on_the_way(older, newest, min(stamp_ns, newest[0] + EXTRAPOLATION_LIMIT_NS))
            newer = older
        return newest[1] if stamp_ns > newest[0] else newer[1]


def _on_the_way(older: tuple[int, Pose], newer: tuple[int, Pose], stamp_ns: int) -> Pose:
    (older_ns, older_pose), (newer_ns, newer_pose) = older, newer
    if stamp_ns == newer_ns:
        return newer_pose
    fraction = (stamp_ns - older_ns) / (newer_ns - older_ns)
    return se2.compose(older_pose, se2.along(se2.between(older_pose, newer_pose), fraction))
