"""The relations metric (Kuemmerle et al. 2009): how far a trajectory is from known relative poses.

A relation says where the robot was at time t2 as seen from where it was at t1, independent of any
map frame. The error of a trajectory p is what `inverse(p(t1)) * p(t2)` differs by: in translation, the
distance of the two positions; in rotation, the angle between the two headings.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gridwright_client.se2 import Poses, between, compose, wrap
from gridwright_client.trajectory_file import TimedPoses, read_rows

_RELATION_FIELDS = 8
_RELATION_FORM = "`t1 t2 x y z roll pitch yaw`"


@dataclass(frozen=True)
class Relations:
    """Known relative poses."""

    first_ns: NDArray[np.int64]
    """shape (n,)"""
    second_ns: NDArray[np.int64]
    """shape (n,)"""
    first_from_second: Poses
    """shape (n, 3)"""

    def __len__(self) -> int:
        return len(self.first_ns)


@dataclass(frozen=True)
class ErrorStatistics:
    """Of one kind of error; standard deviations are of the sample (n - 1)."""

    mean: float
    deviation: float
    squared_mean: float
    squared_deviation: float
    largest: float


@dataclass(frozen=True)
class Evaluation:
    """A trajectory's score."""

    translation_m: ErrorStatistics
    rotation_deg: ErrorStatistics
    matched: int
    """Relations that entered the statistics."""
    missed: int
    """Relations one of whose times no pose matches, with no odometry to bridge the gap."""
    bridged: int
    """Matched relations one of whose poses was moved by odometry to the relation's time."""


def read_relations(path: Path) -> Relations:
    """Raises OSError where the file cannot be read, FileFormatError where it is something else."""
    rows = read_rows(path, (_RELATION_FIELDS,), 2, _RELATION_FORM)
    return Relations(
        first_ns=np.array([row.stamps_ns[0] for row in rows], dtype=np.int64),
        second_ns=np.array([row.stamps_ns[1] for row in rows], dtype=np.int64),
        first_from_second=np.array([(row.values[0], row.values[1], row.values[5]) for row in rows]),
    )


def evaluate(
    trajectory: TimedPoses, relations: Relations, *, max_dt_s: float, odometry: TimedPoses | None = None
) -> Evaluation:
    """Scores a trajectory.

    A relation's time is matched by the nearest pose within `max_dt_s`; else by the nearest pose, moved
    by the raw odometry between the two times (each the nearest reading), if there is odometry.
    """
    max_dt_ns = round(max_dt_s * 1e9)
    first = _poses_at(relations.first_ns, trajectory, odometry, max_dt_ns)
    second = _poses_at(relations.second_ns, trajectory, odometry, max_dt_ns)
    known = first.is_known & second.is_known
    error = _errors(first.poses[known], second.poses[known], relations.first_from_second[known])
    return Evaluation(
        translation_m=_statistics(np.hypot(error[:, 0], error[:, 1])),
        rotation_deg=_statistics(np.degrees(np.abs(error[:, 2]))),
        matched=int(known.sum()),
        missed=int((~known).sum()),
        bridged=int((known & (first.is_bridged | second.is_bridged)).sum()),
    )


def _errors(first: Poses, second: Poses, first_from_second: Poses) -> Poses:
    """Component-wise, in the frame of the first pose, shape (n, 3)."""
    difference = between(first, second) - first_from_second
    difference[:, 2] = wrap(difference[:, 2])
    return difference


@dataclass(frozen=True)
class _Association:
    poses: Poses
    is_known: NDArray[np.bool_]
    is_bridged: NDArray[np.bool_]


def _poses_at(
    times_ns: NDArray[np.int64], trajectory: TimedPoses, odometry: TimedPoses | None, max_dt_ns: int
) -> _Association:
    nearest = nearest_index(trajectory.stamps_ns, times_ns)
    poses = trajectory.poses[nearest]
    is_near = np.abs(trajectory.stamps_ns[nearest] - times_ns) <= max_dt_ns
    if odometry is None:
        return _Association(poses, is_near, np.zeros_like(is_near))
    then = odometry.poses[nearest_index(odometry.stamps_ns, trajectory.stamps_ns[nearest])]
    now = odometry.poses[nearest_index(odometry.stamps_ns, times_ns)]
    moved = compose(poses, between(then, now))
    known = np.ones_like(is_near)
    return _Association(np.where(is_near[:, np.newaxis], poses, moved), known, ~is_near)


def nearest_index(stamps_ns: NDArray[np.int64], times_ns: NDArray[np.int64]) -> NDArray[np.intp]:
    """For each time the index of the nearest stamp, shape (times,).

    Stamps need not be sorted; of equally near ones the earlier in time, then in order, is taken.
    """
    order = np.argsort(stamps_ns, kind="stable")
    ascending = stamps_ns[order]
    after = np.searchsorted(ascending, times_ns, side="left")
    before_ns = ascending[np.maximum(after - 1, 0)]
    after_ns = ascending[np.minimum(after, len(ascending) - 1)]
    take_before = np.abs(times_ns - before_ns) <= np.abs(after_ns - times_ns)
    chosen_ns = np.where(take_before, before_ns, after_ns)
    return order[np.searchsorted(ascending, chosen_ns, side="left")]


def _statistics(errors: NDArray[np.float64]) -> ErrorStatistics:
    """NaN where there is nothing to average."""
    squares = errors**2
    return ErrorStatistics(
        mean=float(errors.mean()) if errors.size else float("nan"),
        deviation=_sample_deviation(errors),
        squared_mean=float(squares.mean()) if errors.size else float("nan"),
        squared_deviation=_sample_deviation(squares),
        largest=float(errors.max()) if errors.size else float("nan"),
    )


def _sample_deviation(values: NDArray[np.float64]) -> float:
    return float(values.std(ddof=1)) if values.size > 1 else float("nan")
