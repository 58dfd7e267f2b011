"""Algorithm 1: the update of all particles with one scan."""

import itertools
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from gridwright_server.config import MapperConfig
from gridwright_server.slam.beams import Beams
from gridwright_server.slam.grid.lattice import PageTables, Places, places_around
from gridwright_server.slam.grid.maps import Maps, View
from gridwright_server.slam.grid.sector import sector_outline
from gridwright_server.slam.grid.tiles import TilePool
from gridwright_server.slam.matching.match import Matching
from gridwright_server.slam.motion import MotionNoise, noise_of
from gridwright_server.slam.parameters import DRAW_LIMIT, Parameters
from gridwright_server.slam.particles import Proposed, fit_at, integrate_scan, propose, want
from gridwright_server.slam.resampling import effective_sample_size, low_variance_ancestors, normalised
from gridwright_server.slam.se2 import compose_all, wrap
from gridwright_server.slam.trajectory import Ancestry
from gridwright_server.slam.types import Pose, Workers


class ParticleFilter:
    """Poses, weights, maps and trajectories of all particles.

    Results do not depend on the number of workers: each particle's row is written by one of them, and
    every draw comes from a counter-based generator keyed by seed and update.
    """

    def __init__(self, config: MapperConfig, seed: int, workers: Workers, worker_count: int) -> None:
        self._config, self._seed = config, seed
        self._workers = workers
        self._shares = _shares(config.particles, worker_count)
        self._parameters = Parameters(config)
        self.grid = self._parameters.grid
        self.pool = TilePool(self.grid.tile_cells, self.grid.block_cells)
        self.pages = PageTables(config.particles, self.pool)
        self.ancestry = Ancestry()
        self.poses: NDArray[np.float64] = np.zeros((config.particles, 3))
        """shape (particles, 3), map_from_base at the last update"""
        self.covariance: NDArray[np.float64] = np.zeros((3, 3))
        self.effective_sample_size = float(config.particles)
        """N_eff of the last update, before it resampled."""
        self.best = 0
        """The particle whose whole line explains the scans best."""
        self.generation = 0
        """Grows when a particle of another line becomes the best."""
        self.updates = 0
        self._log_weights: NDArray[np.float64] = np.zeros(config.particles)
        self._line_log_weights: NDArray[np.float64] = np.zeros(config.particles)
        self._parents: NDArray[np.int64] = np.arange(config.particles)

    def start(self, pose: Pose, beams: Beams) -> None:
        """The first scan: all particles stand at `pose`, which thus defines the frame map."""
        poses = np.tile(pose, (self._config.particles, 1))
        places = self._places(poses, beams, noise_of(self._config.motion, np.zeros(3)))
        self.poses = poses
        self._integrate(places, self._view(beams))
        self._close_update()

    def update(self, moved: Pose, beams: Beams) -> None:
        """One pass of Algorithm 1; `moved` is the odometry since the last update, old base from new.

        Raises ResourceExhaustedError, and changes nothing, where the map would become too large.
        """
        noise = noise_of(self._config.motion, moved)
        # x' = x_{t-1} (+) u
        predicted = compose_all(self.poses, moved)
        places = self._places(predicted, beams, noise)
        view = self._view(beams)
        draws, comb_offset = self._draw()
        # x^ = argmax p(x | m, z, x'); x_t ~ N(mu, Sigma), or from the motion model where that fails
        matching = self._parameters.matching(noise, len(beams.bearings_rad))
        proposed = self._propose(places, predicted, draws, view, matching)
        self.poses = proposed.poses
        # w_t = w_{t-1} * eta
        self._weigh(proposed)
        # m_t = integrateScan(m_{t-1}, x_t, z_t)
        self._integrate(places, view)
        self._close_update()
        # resample if N_eff < T
        if self.effective_sample_size < self._config.resampling.threshold_ratio * len(self.poses):
            self._resample(comb_offset)

    def fit_of(self, moved: Pose, beams: Beams) -> float:
        """How well a scan fits the best map where odometry puts it: 1 = all end points on surfaces."""
        best = self.best
        predicted = compose_all(self.poses, moved)
        places = self._places(predicted, beams, noise_of(self._config.motion, moved))
        return fit_at(self._maps(places), best, predicted[best], beams.points, self.grid)

    def best_path(self) -> NDArray[np.float64]:
        """The best particle's poses at all updates, shape (updates, 3)."""
        return self.ancestry.path(int(self._parents[self.best]))

    def _places(self, poses: NDArray[np.float64], beams: Beams, noise: MotionNoise) -> Places:
        """The parts of the maps that an update can touch; made room for."""
        radius_m = beams.reach_m + self._parameters.slack_m + DRAW_LIMIT * noise.translation_m
        places = places_around(poses, radius_m, self._parameters.tile_m)
        self.pages.check(places.box)
        self.pages.cover(places.box)
        return places

    def _view(self, beams: Beams) -> View:
        margin_m = self.grid.resolution_m
        return View(beams.points, sector_outline(beams.bearings_rad, beams.ranges_m, margin_m, beams.laser))

    def _draw(self) -> tuple[NDArray[np.float64], float]:
        """Standard normal draws, shape (particles, 3), and where the resampling comb starts."""
        # As a list, a seed above 2^63 would become a float64, and near-by seeds the same.
        key = np.array((self._seed, self.updates), np.uint64)
        generator = np.random.Generator(np.random.Philox(key=key))
        draws = generator.standard_normal((len(self.poses), 3))
        return np.clip(draws, -DRAW_LIMIT, DRAW_LIMIT), generator.random()

    def _propose(
        self,
        places: Places,
        predicted: NDArray[np.float64],
        draws: NDArray[np.float64],
        view: View,
        matching: Matching,
    ) -> Proposed:
        count = len(predicted)
        out = Proposed(
            np.empty((count, 3)),
            np.empty((count, 3)),
            np.empty((count, 3, 3)),
            np.empty(count),
            np.empty(count),
            np.empty(count, np.int64),
        )
        maps = self._maps(places)
        self._on_all(
            lambda begin, end: propose(maps, predicted, draws, view, self.grid, matching, begin, end, out)
        )
        return out

    def _weigh(self, proposed: Proposed) -> None:
        log_eta = proposed.log_weights * self._config.sensor.weight_gain
        self._log_weights = self._log_weights + log_eta
        self._line_log_weights = self._line_log_weights + log_eta
        weights = normalised(self._log_weights)
        self.effective_sample_size = effective_sample_size(weights)
        self.covariance = _mixture_covariance(weights, proposed.means, proposed.covariances)

    def _integrate(self, places: Places, view: View) -> None:
        maps, poses = self._maps(places), self.poses
        wanted = np.zeros(maps.tables.shape, np.bool_)
        self._on_all(lambda begin, end: want(maps, poses, view, self.grid, begin, end, wanted))
        # One after the other: which tile a particle gets must not depend on which worker came first.
        for table, mask in zip(maps.tables, wanted, strict=True):
            self.pool.make_writable(table, mask)
        self.pages.replace(places, maps.tables)
        maps = maps._replace(arrays=self.pool.arrays)  # making room may have moved them
        self._on_all(lambda begin, end: integrate_scan(maps, poses, view, self.grid, begin, end))

    def _maps(self, places: Places) -> Maps:
        return Maps(self.pool.arrays, self.pages.parts(places), places.first_tiles * self.grid.tile_cells)

    def _close_update(self) -> None:
        self.ancestry.append(self.poses.copy(), self._parents)
        self._parents = np.arange(len(self.poses))
        self.updates += 1
        best = int(self._line_log_weights.argmax())
        self.generation += best != self.best
        self.best = best

    def _resample(self, comb_offset: float) -> None:
        ancestors = low_variance_ancestors(normalised(self._log_weights), comb_offset)
        self.pages.resample(ancestors)
        self.poses = self.poses[ancestors]
        self._line_log_weights = self._line_log_weights[ancestors]
        self._log_weights = np.zeros(len(ancestors))
        self._parents = ancestors
        best = int(self._line_log_weights.argmax())
        self.generation += int(ancestors[best]) != self.best
        self.best = best

    def _on_all(self, work: Callable[[int, int], None]) -> None:
        """Runs work(begin, end) over all particles, a share for each worker."""
        if len(self._shares) == 1:
            work(*self._shares[0])
        else:
            for _ in self._workers.map(work, *zip(*self._shares, strict=True)):
                pass


def _shares(particles: int, worker_count: int) -> list[tuple[int, int]]:
    cuts = np.linspace(0, particles, min(worker_count, particles) + 1).round().astype(int).tolist()
    return list(itertools.pairwise(cuts))


def _mixture_covariance(
    weights: NDArray[np.float64], means: NDArray[np.float64], covariances: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Second moments of a mixture of Gaussians, shape (3, 3); headings are averaged around the best's."""
    offsets = means - means[weights.argmax()]
    offsets[:, 2] = [wrap(angle) for angle in offsets[:, 2]]
    offsets -= weights @ offsets
    covariance: NDArray[np.float64] = np.einsum("p,pi,pj->ij", weights, offsets, offsets)
    covariance += np.einsum("p,pij->ij", weights, covariances)
    return covariance
