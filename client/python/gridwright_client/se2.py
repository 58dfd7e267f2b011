"""Rigid motions of the plane, vectorised.

A pose is a float64 array (x_m, y_m, theta_rad) on the last axis; leading axes broadcast. Composition
reads left to right: with poses a_from_b and b_from_c, compose gives a_from_c.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

Poses = NDArray[np.float64]
"""shape (..., 3): x in m, y in m, theta in rad."""

_SMALL_ANGLE_RAD = 1e-6  # below, sin(t)/t and (1-cos(t))/t are their series to machine precision


def wrap(angle_rad: ArrayLike) -> NDArray[np.float64]:
    """The same angles within [-pi, pi)."""
    return np.asarray((np.asarray(angle_rad, dtype=np.float64) + np.pi) % (2 * np.pi) - np.pi)


def compose(a_from_b: Poses, b_from_c: Poses) -> Poses:
    """a_from_c, shape (..., 3)."""
    x, y, theta = np.moveaxis(np.asarray(a_from_b), -1, 0)
    u, v, phi = np.moveaxis(np.asarray(b_from_c), -1, 0)
    cos, sin = np.cos(theta), np.sin(theta)
    return np.stack((x + cos * u - sin * v, y + sin * u + cos * v, wrap(theta + phi)), axis=-1)


def inverse(a_from_b: Poses) -> Poses:
    """b_from_a, shape (..., 3)."""
    x, y, theta = np.moveaxis(np.asarray(a_from_b), -1, 0)
    cos, sin = np.cos(theta), np.sin(theta)
    return np.stack((-cos * x - sin * y, sin * x - cos * y, wrap(-theta)), axis=-1)


def between(a_from_b: Poses, a_from_c: Poses) -> Poses:
    """b_from_c: the motion that leads from the first pose to the second, shape (..., 3)."""
    return compose(inverse(a_from_b), a_from_c)


def exponential(twist: Poses) -> Poses:
    """The pose reached by a constant twist (forward m, left m, turn rad) held for one unit of time."""
    u, v, turn = np.moveaxis(np.asarray(twist), -1, 0)
    along, across = _arc_factors(turn)
    return np.stack((along * u - across * v, across * u + along * v, wrap(turn)), axis=-1)


def logarithm(pose: Poses) -> Poses:
    """The constant twist that reaches the pose in one unit of time, turning by less than half a turn."""
    x, y, theta = np.moveaxis(np.asarray(pose), -1, 0)
    turn = wrap(theta)
    along, across = _arc_factors(turn)
    norm = along**2 + across**2
    u, v = (along * x + across * y) / norm, (along * y - across * x) / norm
    return np.stack((u, v, turn), axis=-1)


def interpolate(start: Poses, end: Poses, fraction: ArrayLike) -> Poses:
    """The pose at a fraction of the way on the arc of constant twist from start to end.

    A component-wise mean would cut the corner of a turning robot. `fraction` broadcasts against
    the leading axes; outside [0, 1] the arc goes on.
    """
    share = np.asarray(fraction, dtype=np.float64)[..., np.newaxis]
    return compose(start, exponential(share * logarithm(between(start, end))))


def _arc_factors(turn: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """sin(t) / t and (1 - cos(t)) / t."""
    is_small = np.abs(turn) < _SMALL_ANGLE_RAD
    divisor = np.where(is_small, 1.0, turn)
    along = np.where(is_small, 1.0 - turn**2 / 6.0, np.sin(turn) / divisor)
    across = np.where(is_small, turn / 2.0, (1.0 - np.cos(turn)) / divisor)
    return along, across
