"""The motion model p(x_t | x_{t-1}, u) and the motion filter."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridwright_server.config import MotionConfig
from gridwright_server.slam.se2 import wrap
from gridwright_server.slam.types import Pose


@dataclass(frozen=True)
class MotionNoise:
    """Standard deviations of a Gaussian around the pose that odometry predicts.

    The translational part is isotropic: wheels that slip move a robot sideways too.
    """

    translation_m: float
    rotation_rad: float

    def covariance(self) -> NDArray[np.float64]:
        """shape (3, 3), in m^2 and rad^2."""
        return np.diag([self.translation_m**2, self.translation_m**2, self.rotation_rad**2])


def noise_of(config: MotionConfig, moved: Pose) -> MotionNoise:
    """How far odometry may be off after it reports the motion `moved` (old base from new base)."""
    drift = drift_of(config, moved)
    return MotionNoise(
        math.hypot(config.translation_sigma_floor_meters, drift.translation_m),
        math.hypot(config.rotation_sigma_floor_radians, drift.rotation_rad),
    )


def drift_of(config: MotionConfig, moved: Pose) -> MotionNoise:
    """The part of it that grows with the motion: none at rest."""
    distance_m, turn_rad = math.hypot(moved[0], moved[1]), abs(wrap(moved[2]))
    return MotionNoise(
        config.translation_sigma_per_meter * distance_m + config.translation_sigma_per_radian * turn_rad,
        config.rotation_sigma_per_meter * distance_m + config.rotation_sigma_per_radian * turn_rad,
    )


def is_update_due(config: MotionConfig, moved: Pose) -> bool:
    """The motion filter: has the robot moved or turned enough since the last processed scan?"""
    return (
        math.hypot(moved[0], moved[1]) >= config.update_distance_meters
        or abs(wrap(moved[2])) >= config.update_angle_radians
    )
