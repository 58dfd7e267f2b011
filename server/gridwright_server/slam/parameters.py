"""What the kernels need of the configuration, in their units: cells, steps and integers."""

import math

import numpy as np

from gridwright_server.config import MapperConfig
from gridwright_server.slam.grid.likelihood import LikelihoodModel, likelihood_model
from gridwright_server.slam.grid.maps import Grid
from gridwright_server.slam.grid.occupancy import log_odds_units
from gridwright_server.slam.grid.tiles import MINIMUM_TILE_CELLS
from gridwright_server.slam.matching.match import Matching, search_slack_cells
from gridwright_server.slam.matching.multilevel import Objective, Window
from gridwright_server.slam.motion import MotionNoise
from gridwright_server.slam.proposal import Lattice

DRAW_LIMIT = 3.0
"""Standard normal draws are cut off here, so that a particle stays within the part of the map laid out."""

INDEPENDENT_BEAMS = 180
"""A scan of more beams says no more than one of so many: neighbours closer than a degree see the same.

So odometry, the scan and the particles' weights keep their balance whatever the laser's resolution.
"""


class Parameters:
    """A configuration's constants, worked out once."""

    def __init__(self, config: MapperConfig) -> None:
        model = likelihood_model(config.sensor, config.grid.resolution_meters)
        self.grid = _grid_of(config, model)
        self._window = _window_of(config, 1)
        self._wide_window = _window_of(config, config.matching.widening)
        self._lattice = _lattice_of(config)
        self._likelihood_scale = model.log_likelihood_per_step * config.sensor.likelihood_gain
        self._scores = config.matching.minimum_score, config.matching.doubtful_score

    @property
    def tile_m(self) -> float:
        """Side of a tile."""
        return self.grid.tile_cells * self.grid.resolution_m

    @property
    def slack_m(self) -> float:
        """How far beyond its end points an update may read or write a map, wherever it draws from."""
        searched = search_slack_cells(self._wide_window, self.grid.block_cells, self._lattice)
        drawn = math.ceil(
            DRAW_LIMIT * float(self._lattice.extent[0])
        )  # no wider than the lattice it was fitted to
        # A surface that goes changes the field a stamp's size around it.
        return (searched + drawn + len(self.grid.stamp)) * self.grid.resolution_m

    def matching(self, noise: MotionNoise, beams: int) -> Matching:
        """How to match a scan of that many beams after a motion with that noise."""
        objective = Objective(
            self._likelihood_scale * min(1.0, INDEPENDENT_BEAMS / max(beams, 1)),
            (self.grid.resolution_m / noise.translation_m) ** 2,
            1.0 / noise.rotation_rad**2,
        )
        return Matching(
            self._window,
            self._wide_window,
            objective,
            self._lattice,
            *self._scores,
            noise.translation_m,
            noise.rotation_rad,
        )


def _grid_of(config: MapperConfig, model: LikelihoodModel) -> Grid:
    factor = config.grid.coarse_factor
    quarter = _quarter(factor)
    return Grid(
        config.grid.resolution_meters,
        factor * math.ceil(MINIMUM_TILE_CELLS / factor),
        next(block for block in (5, 4, 3, 2, 1) if quarter % block == 0),
        log_odds_units(config.grid.free_log_odds),
        log_odds_units(config.grid.hit_log_odds),
        log_odds_units(config.grid.log_odds_limit),
        model.stamp,
    )


def _quarter(coarse_factor: int) -> int:
    return coarse_factor // 2 if coarse_factor % 2 == 0 else coarse_factor


def _window_of(config: MapperConfig, widening: int) -> Window:
    matching, factor = config.matching, config.grid.coarse_factor
    voxel_m = config.grid.resolution_meters * factor
    half_steps = math.ceil(matching.window_radians / matching.angle_step_radians - 1e-9)
    once_around = math.ceil(math.pi / matching.angle_step_radians)
    # Rounded up to whole voxels and steps; the small number forgives binary fractions.
    return Window(
        widening * math.ceil(matching.window_meters / voxel_m - 1e-9),
        min(widening * half_steps, once_around),
        matching.angle_step_radians,
        factor,
        _quarter(factor),
    )


def _lattice_of(config: MapperConfig) -> Lattice:
    extent_cells = config.proposal.extent_meters / config.grid.resolution_meters
    extent = np.array((extent_cells, extent_cells, config.proposal.extent_radians))
    return Lattice(extent, config.proposal.samples_per_axis)
