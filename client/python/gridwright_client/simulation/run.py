"""One simulated run from start to end."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridwright_client.carmen.geometry import beam_geometry
from gridwright_client.carmen.readings import FRONT
from gridwright_client.se2 import Poses, compose
from gridwright_client.simulation.building import office_floor
from gridwright_client.simulation.drive import drive, waypoints
from gridwright_client.simulation.sensors import LaserModel, measure_odometry, measure_ranges

TICK_NS = 62_500_000
"""Odometry comes at 16 Hz."""
TICKS_PER_SCAN = 2
LASER_OFFSET_M = 0.12
_START_NS = 1_500_000_000_000_000_000


@dataclass(frozen=True)
class SimulationOptions:
    """What a user may choose."""

    seed: int = 0
    laps: int = 2
    """Around the loop; the first goes through rooms."""
    duration_s: float | None = None
    """Stop after this much robot time; None = when the laps are done."""
    beams: int = 180


@dataclass(frozen=True)
class Simulation:
    """What happened at each tick of odometry, and at the ticks with a scan."""

    stamps_ns: NDArray[np.int64]
    """shape (ticks,)"""
    map_from_base: Poses
    """The truth, shape (ticks, 3)."""
    odom_from_base: Poses
    """shape (ticks, 3)"""
    scan_ticks: NDArray[np.intp]
    """shape (scans,)"""
    ranges_m: NDArray[np.float64]
    """shape (scans, beams)"""
    range_max_m: float
    base_from_laser: Poses

    @property
    def path_m(self) -> float:
        """How far the robot drove."""
        return float(np.hypot(*np.diff(self.map_from_base[:, :2], axis=0).T).sum())


def run_simulation(options: SimulationOptions) -> Simulation:
    """Drives and measures; the same options give the same run."""
    rng = np.random.default_rng(options.seed)
    building = office_floor()
    laser = LaserModel(beam_geometry(options.beams, FRONT, None, {}).bearings_rad())
    map_from_base = drive(waypoints(options.laps), TICK_NS * 1e-9)
    if options.duration_s is not None:
        map_from_base = map_from_base[: max(2, round(options.duration_s * 1e9 / TICK_NS) + 1)]
    odom_from_base = measure_odometry(map_from_base, rng)
    scan_ticks = np.arange(0, len(map_from_base), TICKS_PER_SCAN)
    base_from_laser = np.array((LASER_OFFSET_M, 0.0, 0.0))
    map_from_laser = compose(map_from_base[scan_ticks], base_from_laser)
    return Simulation(
        stamps_ns=_START_NS + TICK_NS * np.arange(len(map_from_base), dtype=np.int64),
        map_from_base=map_from_base,
        odom_from_base=odom_from_base,
        scan_ticks=scan_ticks,
        ranges_m=np.array([measure_ranges(building, pose, laser, rng) for pose in map_from_laser]),
        range_max_m=laser.range_max_m,
        base_from_laser=base_from_laser,
    )
