"""Every scan of a session, processed or not, and the poses they get from a particle's path."""

import math

import numpy as np
from numpy.typing import NDArray

from gridwright_server.jit import kernel
from gridwright_server.slam.se2 import along, between, compose
from gridwright_server.slam.types import Pose, Trajectory

METERS_PER_RADIAN = 0.5
"""How far along the way between two updates a turn counts, beside the distance driven."""


class ScanRecord:
    """Time and odometry of each scan, in order of arrival; 41 bytes a scan."""

    def __init__(self) -> None:
        self._count = 0
        self._stamps_ns: NDArray[np.int64] = np.empty(1024, np.int64)
        self._odom_from_base: NDArray[np.float64] = np.empty((1024, 3))
        self._updates: NDArray[np.int64] = np.empty(1024, np.int64)
        self._processed: NDArray[np.bool_] = np.empty(1024, np.bool_)

    def append(self, stamp_ns: int, odom_from_base: Pose, update: int, processed: bool) -> None:
        """`update` is the number of the update that the scan made, or that was the last before it."""
        if self._count == len(self._stamps_ns):
            self._double()
        k = self._count
        self._stamps_ns[k], self._odom_from_base[k] = stamp_ns, odom_from_base
        self._updates[k], self._processed[k] = update, processed
        self._count += 1

    def along_path(self, path: NDArray[np.float64]) -> Trajectory:
        """All scans posed by a path, shape (updates, 3), map_from_base at each update.

        A skipped scan gets the odometry since the update before it, bent so that it leads to the pose
        of the update after it: what odometry misses there is spread over the way.
        """
        n = self._count
        stamps_ns, processed = self._stamps_ns[:n].copy(), self._processed[:n].copy()
        poses = _pose_scans(path, self._odom_from_base[:n], self._updates[:n], processed)
        return Trajectory(stamps_ns, poses, processed)

    def _double(self) -> None:
        for name in ("_stamps_ns", "_odom_from_base", "_updates", "_processed"):
            array = getattr(self, name)
            setattr(self, name, np.concatenate([array, np.empty_like(array)]))


@kernel
def _pose_scans(path, odom_from_base, updates, processed):
    update_odom = np.empty_like(path)
    for k in range(len(updates)):
        if processed[k]:
            update_odom[updates[k]] = odom_from_base[k]
    poses = np.empty_like(odom_from_base)
    for k in range(len(updates)):
        u = updates[k]
        moved = between(update_odom[u], odom_from_base[k])
        pose = compose(path[u], moved)
        if not processed[k] and u + 1 < len(path):
            whole = between(update_odom[u], update_odom[u + 1])
            missed = between(compose(path[u], whole), path[u + 1])
            way = _length(whole)
            fraction = min(_length(moved) / way, 1.0) if way > 0.0 else 0.0
            pose = compose(pose, along(missed, fraction))
        poses[k] = pose
    return poses


@kernel
def _length(moved):
    return math.hypot(moved[0], moved[1]) + METERS_PER_RADIAN * abs(moved[2])
