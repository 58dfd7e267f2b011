"""The same log, seed and configuration give the same result; extreme configurations give one at all."""

from dataclasses import replace

import numpy as np
import pytest
from gridwright_server.config import (
    GridConfig,
    MatchingConfig,
    MotionConfig,
    ProposalConfig,
    SensorConfig,
)
from gridwright_server.slam.grid.tiles import NO_TILE
from gridwright_server.slam.mapper import Mapper
from gridwright_server.slam.types import Verdict
from mapped_room import BLURRED, CONFIG, feed, fingerprint, run
from naive.one_map import field_of
from simulated_room import (
    FULL_CIRCLE,
    drifting,
    drive,
)


class TestDeterminism:
    def test_threads_and_runs_change_nothing_and_the_seed_does(self, workers):
        once = run(workers)
        assert run(workers) == once
        assert run(workers, threads=2) == once
        assert run(workers, threads=4) == once
        assert run(workers, threads=20) == once
        assert run(workers, seed=6) != once

    def test_neither_where_matches_fail_and_odometry_is_trusted_little(self, workers):
        """Poses drawn far from where they were expected read nothing that another particle left behind."""
        config = replace(
            CONFIG,
            matching=MatchingConfig(minimum_score=1.0, window_meters=0.1, window_radians=0.02),
            motion=MotionConfig(translation_sigma_floor_meters=2.5, rotation_sigma_floor_radians=1.0),
        )
        for seed in range(8):
            alone, shared = (
                run(workers, seed, threads, config, steps=8, bearings_rad=FULL_CIRCLE) for threads in (6, 1)
            )
            assert alone == shared

    def test_any_seed_of_64_bits_will_do(self, workers):
        drives = [run(workers, seed=seed, steps=6) for seed in (0, 2**63, 2**63 + 1, 2**64 - 1)]
        assert len({drive[0] for drive in drives}) == 4


@pytest.mark.parametrize(
    "config",
    [
        CONFIG,
        replace(CONFIG, grid=GridConfig(resolution_meters=0.2, coarse_factor=2), sensor=BLURRED),
    ],
    ids=["default", "walls blurred far"],
)
def test_every_particles_field_is_that_of_its_surfaces(workers, config):
    """Also where a wall's field reaches farther than the search looks."""
    mapper = Mapper(config, 1, workers, 2)
    poses = drive(10)
    feed(mapper, poses, drifting(poses))
    particles, resolution_m = mapper._filter, config.grid.resolution_meters
    n = particles.pool.tile_cells
    for table in particles.pages.tables[::2]:
        surfaces = []
        for place in zip(*np.nonzero(table != NO_TILE), strict=True):
            inside = np.argwhere(particles.pool.arrays.log_odds[table[place]] > 0)
            surfaces += [tuple(cell) for cell in inside + np.array(place) * n]
        assert surfaces
        sensor = config.sensor
        rows, columns = (np.arange(tiles * n) for tiles in table.shape)
        field = field_of(
            surfaces, rows, columns, resolution_m, sensor.hit_sigma_meters, sensor.outlier_probability
        )
        for row, column in zip(*np.nonzero(table != NO_TILE), strict=True):
            np.testing.assert_array_equal(
                particles.pool.arrays.field[table[row, column]],
                field[row * n : (row + 1) * n, column * n : (column + 1) * n],
            )
        assert field.any()


class TestWholeConfigurations:
    """Whatever the bounds allow must not touch memory that is not a map's."""

    @pytest.mark.parametrize(
        "changes",
        [
            {"matching": MatchingConfig(window_meters=0.01, window_radians=0.001)},
            {"sensor": SensorConfig(hit_sigma_meters=0.8)},
            {"grid": GridConfig(resolution_meters=0.2, coarse_factor=2), "sensor": BLURRED},
            {"proposal": ProposalConfig(extent_meters=1.0, extent_radians=1.0, samples_per_axis=3)},
            {"motion": MotionConfig(update_distance_meters=0.0, update_angle_radians=0.0)},
            {"particles": 1},
        ],
        ids=[
            "hardly a window",
            "blurred walls",
            "walls blurred far",
            "wide proposal",
            "every scan",
            "one particle",
        ],
    )
    def test_it_maps_and_repeats_itself(self, workers, changes):
        config = replace(replace(CONFIG, particles=3), **changes)
        config.check()
        poses = drive(5)
        runs = []
        for threads in (1, 2):
            mapper = Mapper(config, 1, workers, threads)
            results = feed(mapper, poses, drifting(poses), bearings_rad=FULL_CIRCLE[::4].copy())
            assert all(result.verdict is Verdict.PROCESSED for result in results)
            assert all(np.isfinite(result.estimate.map_from_base).all() for result in results)
            runs.append(fingerprint(mapper))
        assert runs[0] == runs[1]
