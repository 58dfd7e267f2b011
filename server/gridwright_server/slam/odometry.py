"""Odometry readings and the pose they give at a scan's time."""

from collections import deque

from gridwright_server.slam import se2
from gridwright_server.slam.types import Pose

HISTORY = 1024
"""Readings kept: ten seconds of a fast robot's odometry, far more than a scan is late."""

EXTRAPOLATION_LIMIT_NS = 250_000_000
"""How far beyond the newest reading its speed is trusted."""


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
        the newest counts. Beyond the newest reading the robot is taken to go on as between the last
        two, for at most EXTRAPOLATION_LIMIT_NS; before the oldest reading, to have stood there.
        """
        if len(self._readings) == 1:
            return self._readings[0][1]
        newer = self._readings[-1]
        older = self._readings[-2]
        if stamp_ns > max(newer[0], older[0]):
            if newer[0] <= older[0]:  # the clock stepped back: there is no speed to go on at
                return newer[1]
            ahead_ns = min(stamp_ns, newer[0] + EXTRAPOLATION_LIMIT_NS)
            return _on_the_way(older, newer, ahead_ns)
        for older in _backwards(self._readings):
            if min(older[0], newer[0]) <= stamp_ns <= max(older[0], newer[0]):
                return _on_the_way(older, newer, stamp_ns)
            newer = older
        return self._readings[0][1]


def _backwards(readings: deque[tuple[int, Pose]]) -> list[tuple[int, Pose]]:
    return list(readings)[-2::-1]


def _on_the_way(older: tuple[int, Pose], newer: tuple[int, Pose], stamp_ns: int) -> Pose:
    (older_ns, older_pose), (newer_ns, newer_pose) = older, newer
    if newer_ns in (older_ns, stamp_ns):
        return newer_pose
    fraction = (stamp_ns - older_ns) / (newer_ns - older_ns)
    return se2.compose(older_pose, se2.along(se2.between(older_pose, newer_pose), fraction))
