"""What the robot measures: odometry that drifts, and noisy ranges."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridwright_client.se2 import Poses, between, compose, exponential, logarithm
from gridwright_client.simulation.building import Building

_SCALE_ERROR = 0.03
_SMALLEST_VEER_RAD_M = 0.006
_LARGEST_VEER_RAD_M = 0.010
_TURN_SCALE_ERROR = 0.02
_STEP_NOISE = 0.05
_TURN_NOISE = 0.05
_TURN_NOISE_RAD_SQRT_M = 0.01
_CLOSEST_M = 0.02


@dataclass(frozen=True)
class LaserModel:
    """A planar laser; a beam that meets nothing within its reach reads `range_max_m`."""

    bearings_rad: NDArray[np.float64]
    """shape (beams,)"""
    range_max_m: float = 12.0
    sigma_m: float = 0.015
    short_share: float = 0.003
    """Of the beams that something in the air throws back early."""
    lost_share: float = 0.004
    """Of the beams that do not come back."""


def cast_rays(building: Building, map_from_laser: Poses, bearings_rad: NDArray[np.float64]) -> Poses:
    """The distance to the first wall in m along each beam, shape (beams,); Inf where there is none."""
    x, y, theta = map_from_laser
    dx, dy = np.cos(theta + bearings_rad)[:, np.newaxis], np.sin(theta + bearings_rad)[:, np.newaxis]
    (start_x, start_y), (end_x, end_y) = building.walls[:, 0].T, building.walls[:, 1].T
    along_x, along_y = end_x - start_x, end_y - start_y
    to_x, to_y = start_x - x, start_y - y
    # ray + r (dx, dy) = start + s along, solved by Cramer's rule for every beam and wall.
    with np.errstate(divide="ignore", invalid="ignore"):
        determinant = dx * along_y - dy * along_x
        distance = (to_x * along_y - to_y * along_x) / determinant
        share = (to_x * dy - to_y * dx) / determinant
    hits = (distance > 0.0) & (share >= 0.0) & (share <= 1.0)
    return np.asarray(np.where(hits, distance, np.inf).min(axis=1))


def measure_ranges(
    building: Building, map_from_laser: Poses, laser: LaserModel, rng: np.random.Generator
) -> NDArray[np.float64]:
    """One sweep in m, to the centimetre, shape (beams,)."""
    exact = cast_rays(building, map_from_laser, laser.bearings_rad)
    beams = exact.shape
    ranges_m = exact + rng.normal(0.0, laser.sigma_m, beams)
    kind = rng.random(beams)
    ranges_m = np.where(kind < laser.short_share, exact * rng.random(beams), ranges_m)
    ranges_m[kind > 1.0 - laser.lost_share] = np.inf
    within = ranges_m < laser.range_max_m
    return np.where(within, np.round(np.maximum(ranges_m, _CLOSEST_M), 2), laser.range_max_m)


def measure_odometry(map_from_base: Poses, rng: np.random.Generator) -> Poses:
    """Dead reckoning from the origin at each true pose, shape (n, 3).

    One wheel is larger than the robot believes: it veers to one side by a constant angle per metre
    (6 to 10 mrad), and distances and turns are off by a constant factor; noise comes on top.
    """
    twists = logarithm(between(map_from_base[:-1], map_from_base[1:]))
    veer = rng.uniform(_SMALLEST_VEER_RAD_M, _LARGEST_VEER_RAD_M) * rng.choice((-1.0, 1.0))
    forward, turn = twists[:, 0], twists[:, 2]
    noise = rng.normal(0.0, 1.0, (3, len(twists)))
    measured = np.zeros_like(twists)
    measured[:, 0] = forward * (1.0 + rng.uniform(-1.0, 1.0) * _SCALE_ERROR + _STEP_NOISE * noise[0])
    measured[:, 2] = turn * (1.0 + rng.uniform(-1.0, 1.0) * _TURN_SCALE_ERROR + _TURN_NOISE * noise[1])
    measured[:, 2] += veer * forward + _TURN_NOISE_RAD_SQRT_M * np.sqrt(np.abs(forward)) * noise[2]
    return _chain(exponential(measured))


def _chain(steps: Poses) -> Poses:
    poses = np.zeros((len(steps) + 1, 3))
    for index, step in enumerate(steps):
        poses[index + 1] = compose(poses[index], step)
    return poses
