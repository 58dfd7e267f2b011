"""A scan as the filter uses it: end points and sectors in the robot's frame."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridwright_server.slam.types import Scan


@dataclass(frozen=True)
class Beams:
    """The beams of one scan, in base_link."""

    laser: NDArray[np.float64]
    """shape (2,): where the beams start, in m"""
    bearings_rad: NDArray[np.float64]
    """shape (beams,): their directions in base_link, ascending or descending"""
    ranges_m: NDArray[np.float64]
    """shape (beams,): distance to what they hit; 0 = no return"""
    points: NDArray[np.float64]
    """shape (returns, 2): end points of the beams that hit something, in m"""
    reach_m: float
    """Distance of the farthest end point from base_link's origin."""


def beams_of(scan: Scan, usable_range_m: float) -> Beams:
    """Drops what is no return (REP-117) or farther than usable_range_m.

    NaN, infinities and ranges outside [range_min, range_max) never make a hit.
    """
    limit_m = min(scan.range_max_m, usable_range_m)
    with np.errstate(invalid="ignore"):  # NaN compares false, as it should
        is_return = (scan.ranges_m >= scan.range_min_m) & (scan.ranges_m < limit_m) & (scan.ranges_m > 0.0)
    x, y, theta = scan.base_from_laser
    bearings_rad = scan.bearings_rad + theta
    ranges_m = np.where(is_return, scan.ranges_m, 0.0)
    hit_bearings, hit_ranges = bearings_rad[is_return], ranges_m[is_return]
    points = np.empty((len(hit_ranges), 2))
    points[:, 0] = x + hit_ranges * np.cos(hit_bearings)
    points[:, 1] = y + hit_ranges * np.sin(hit_bearings)
    reach_m = float(np.hypot(points[:, 0], points[:, 1]).max()) if len(points) else 0.0
    return Beams(np.array((x, y)), bearings_rad, ranges_m, points, reach_m)
