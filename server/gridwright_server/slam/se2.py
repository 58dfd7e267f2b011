"""Poses in the plane and how they compose: SE(2)."""

import math

import numpy as np
from numpy.typing import NDArray

from gridwright_server.jit import kernel
from gridwright_server.slam.types import Pose


@kernel
def wrap(angle_rad: float) -> float:
    """The same angle in [-pi, pi); up to rounding, which may give pi itself."""
    return float((angle_rad + math.pi) % (2.0 * math.pi) - math.pi)


@kernel
def compose(a_from_b: Pose, b_from_c: Pose) -> Pose:
    """a_from_c = a_from_b (+) b_from_c."""
    c, s = math.cos(a_from_b[2]), math.sin(a_from_b[2])
    a_from_c = np.empty(3)
    a_from_c[0] = a_from_b[0] + c * b_from_c[0] - s * b_from_c[1]
    a_from_c[1] = a_from_b[1] + s * b_from_c[0] + c * b_from_c[1]
    a_from_c[2] = wrap(a_from_b[2] + b_from_c[2])
    return a_from_c


@kernel
def compose_all(a_from_b: NDArray[np.float64], b_from_c: Pose) -> NDArray[np.float64]:
    """compose for many poses a_from_b, shape (n, 3), and one b_from_c; shape (n, 3)."""
    a_from_c = np.empty_like(a_from_b)
    for k in range(len(a_from_b)):
        a_from_c[k] = compose(a_from_b[k], b_from_c)
    return a_from_c


@kernel
def between(a_from_b: Pose, a_from_c: Pose) -> Pose:
    """b_from_c = inverse(a_from_b) (+) a_from_c."""
    c, s = math.cos(a_from_b[2]), math.sin(a_from_b[2])
    dx, dy = a_from_c[0] - a_from_b[0], a_from_c[1] - a_from_b[1]
    b_from_c = np.empty(3)
    b_from_c[0] = c * dx + s * dy
    b_from_c[1] = -s * dx + c * dy
    b_from_c[2] = wrap(a_from_c[2] - a_from_b[2])
    return b_from_c


@kernel
def inverse(a_from_b: Pose) -> Pose:
    """b_from_a."""
    return between(a_from_b, np.zeros(3))


@kernel
def along(a_from_b: Pose, fraction: float) -> Pose:
    """The pose reached after `fraction` of the way to a_from_b at a constant twist.

    Interpolates (0..1) and extrapolates (> 1) on the group: a robot that drives an arc stays on it.
    """
    x, y, angle = a_from_b[0], a_from_b[1], wrap(a_from_b[2])
    # Logarithm: the linear part of the twist; V(angle)^-1 * (x, y).
    half = 0.5 * angle
    cot = 1.0 - half * half / 3.0 if abs(half) < 1e-4 else half / math.tan(half)
    vx, vy = cot * x + half * y, -half * x + cot * y
    # Exponential of the scaled twist.
    turn = fraction * angle
    if abs(turn) < 1e-4:
        sinc, cosc = 1.0 - turn * turn / 6.0, 0.5 * turn
    else:
        sinc, cosc = math.sin(turn) / turn, (1.0 - math.cos(turn)) / turn
    reached = np.empty(3)
    reached[0] = fraction * (sinc * vx - cosc * vy)
    reached[1] = fraction * (cosc * vx + sinc * vy)
    reached[2] = wrap(turn)
    return reached
