"""Where the robot drives: once through the rooms while it goes around the loop, then again around."""

import math

import numpy as np
from numpy.typing import NDArray

from gridwright_client.se2 import Poses

_SPEED_M_S = 0.75
_TURN_RATE_RAD_S = 1.2
_TURN_GAIN_S = 2.5
_REACHED_M = 0.25
_MAX_TICKS = 1_000_000

START = (5.5, 5.5)

_SOUTH_WEST, _SOUTH_EAST, _NORTH_EAST, _NORTH_WEST = (5.5, 5.5), (19.5, 5.5), (19.5, 12.5), (5.5, 12.5)
_PLAIN_LAP = [_SOUTH_EAST, _NORTH_EAST, _NORTH_WEST, _SOUTH_WEST]
_LAP_WITH_ROOMS = [
    *[(11.8, 5.5), (11.8, 3.0), (11.8, 5.5)],
    *[(17.6, 5.5), (17.6, 2.6), (20.6, 2.4), (17.6, 2.6), (17.6, 5.5)],
    _SOUTH_EAST,
    *[(19.5, 7.4), (22.4, 7.4), (19.5, 7.4)],
    _NORTH_EAST,
    *[(15.8, 12.5), (15.8, 9.6), (14.4, 8.2), (10.4, 8.1), (9.3, 7.6), (9.3, 5.5)],
    *[(9.3, 7.6), (10.4, 8.1), (14.4, 8.2), (15.8, 9.6), (15.8, 12.5)],
    *[(13.0, 12.5), (13.0, 15.4), (13.0, 12.5)],
    _NORTH_WEST,
    *[(5.5, 10.4), (2.8, 10.4), (5.5, 10.4)],
    _SOUTH_WEST,
]


def waypoints(laps: int) -> NDArray[np.float64]:
    """The points to drive to, shape (n, 2): the first lap visits rooms, the others do not."""
    return np.array(_LAP_WITH_ROOMS + _PLAIN_LAP * (laps - 1))


def drive(points: NDArray[np.float64], tick_s: float) -> Poses:
    """The robot's pose at each tick, shape (ticks, 3), from START until the last point is reached.

    The robot turns towards the next point and drives the faster the better it looks at it.
    """
    x, y = START
    theta = math.atan2(points[0, 1] - y, points[0, 0] - x)
    poses = [(x, y, theta)]
    target = 0
    while target < len(points) and len(poses) < _MAX_TICKS:
        dx, dy = points[target, 0] - x, points[target, 1] - y
        if math.hypot(dx, dy) < _REACHED_M:
            target += 1
            continue
        off = math.remainder(math.atan2(dy, dx) - theta, math.tau)
        turn = max(-_TURN_RATE_RAD_S, min(_TURN_RATE_RAD_S, _TURN_GAIN_S * off)) * tick_s
        step = _SPEED_M_S * max(0.0, math.cos(off)) ** 4 * tick_s
        x += step * math.cos(theta + turn / 2)
        y += step * math.sin(theta + turn / 2)
        theta = math.remainder(theta + turn, math.tau)
        poses.append((x, y, theta))
    return np.array(poses)
