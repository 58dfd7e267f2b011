"""Known relative poses along a true path."""

import itertools

import numpy as np
from numpy.typing import NDArray

from gridwright_client.evaluation import Relations
from gridwright_client.se2 import between
from gridwright_client.trajectory_file import TimedPoses

_KEY_DISTANCE_M = 0.5
_KEY_ANGLE_RAD = 0.5
_REVISIT_DISTANCE_M = 1.0
_REVISIT_PATH_M = 20.0


def true_relations(truth: TimedPoses) -> Relations:
    """Between successive key poses, and from each to the nearest of those from a former visit.

    Key poses lie half a metre or half a radian apart. A former visit is at least 20 m of path back and
    within 1 m: only a map that closes its loops gets these right.
    """
    steps_m = np.hypot(*np.diff(truth.poses[:, :2], axis=0).T)
    path_m = np.concatenate(([0.0], np.cumsum(steps_m)))
    keys = _key_indices(truth, path_m)
    pairs = list(itertools.pairwise(keys))
    for key in keys:
        former = [other for other in keys if path_m[key] - path_m[other] >= _REVISIT_PATH_M]
        if not former:
            continue
        away_m = np.hypot(*(truth.poses[former, :2] - truth.poses[key, :2]).T)
        if away_m.min() <= _REVISIT_DISTANCE_M:
            pairs.append((former[int(away_m.argmin())], key))
    first, second = np.array(pairs, dtype=np.intp).reshape(-1, 2).T
    return Relations(
        truth.stamps_ns[first], truth.stamps_ns[second], between(truth.poses[first], truth.poses[second])
    )


def _key_indices(truth: TimedPoses, path_m: NDArray[np.float64]) -> list[int]:
    turned_rad = np.abs(np.diff(np.unwrap(truth.poses[:, 2])))
    angle_rad = np.concatenate(([0.0], np.cumsum(turned_rad)))
    keys = [0]
    for index in range(len(truth)):
        moved = path_m[index] - path_m[keys[-1]] >= _KEY_DISTANCE_M
        if moved or angle_rad[index] - angle_rad[keys[-1]] >= _KEY_ANGLE_RAD:
            keys.append(index)
    return keys
