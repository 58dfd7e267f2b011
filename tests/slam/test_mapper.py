"""Where the mapper says it is, whatever the scans are like, in a small room."""

from dataclasses import replace

import numpy as np
import pytest
from gridwright_server.config import (
    GridConfig,
    ResamplingConfig,
)
from gridwright_server.slam import se2
from gridwright_server.slam.mapper import Mapper
from gridwright_server.slam.types import Verdict
from mapped_room import CONFIG, STEPS, errors, feed, nothing_seen, occupancy
from simulated_room import (
    BACKWARDS,
    FRONT,
    FULL_CIRCLE,
    HALF_CIRCLE,
    ROOM,
    SECOND_NS,
    drifting,
    drive,
    scan_at,
)


class TestWhereItIs:
    @pytest.mark.parametrize(
        ("bearings_rad", "base_from_laser"),
        [
            (HALF_CIRCLE, FRONT),
            (HALF_CIRCLE[::-1].copy(), FRONT),
            (HALF_CIRCLE, BACKWARDS),
            (FULL_CIRCLE, np.zeros(3)),
        ],
        ids=["front", "clockwise", "backwards", "361 beams"],
    )
    def test_it_knows_where_it_is_though_odometry_drifts(self, mapper, bearings_rad, base_from_laser):
        poses = drive(STEPS)
        odometry = drifting(poses)
        results = feed(mapper, poses, odometry, bearings_rad=bearings_rad, base_from_laser=base_from_laser)
        assert all(result.verdict is Verdict.PROCESSED for result in results)
        away_m, away_rad = errors(poses, results)
        drift = se2.between(poses[-1], odometry[-1])
        assert abs(drift[2]) > 0.3
        assert np.hypot(*drift[:2]) > 0.2
        assert away_m.max() < 0.08
        assert away_m.mean() < 0.04
        assert away_rad.max() < 0.04
        # The trajectory as known at the end, too.
        path = mapper.trajectory().map_from_base
        late = np.array([se2.between(a, b) for a, b in zip(poses, path, strict=True)])
        assert np.hypot(late[:, 0], late[:, 1]).max() < 0.08

    def test_it_notices_that_the_robot_moves_though_its_wheels_say_no(self, mapper):
        """Odometry that never moves: what the scans show is all there is to go by."""
        poses = drive(STEPS)
        results = feed(mapper, poses, [poses[0]] * len(poses))
        assert sum(result.verdict is Verdict.PROCESSED for result in results) > STEPS // 3
        away_m, away_rad = errors(poses[-1:], results[-1:])
        assert away_m[0] < 0.2
        assert away_rad[0] < 0.1

    def test_a_step_beyond_the_window_is_found_in_the_wide_one(self, mapper):
        poses = drive(STEPS)
        jump = np.array((0.7, 0.0, 0.0))  # almost twice the window's half
        odometry = [pose + jump * (k >= STEPS // 2) for k, pose in enumerate(poses)]
        away_m, _ = errors(poses, feed(mapper, poses, odometry))
        assert away_m[STEPS // 2] < 0.08

    def test_a_robot_at_rest_with_nothing_in_sight_stays_where_it_is(self, mapper):
        """A scan without returns fits nothing; that is no sign of motion."""
        poses = drive(3)
        feed(mapper, poses, poses)
        before = mapper.estimate().map_from_base
        for k in range(4, 30):
            mapper.add_odometry(k * SECOND_NS, poses[-1])
            result = mapper.add_scan(nothing_seen(k * SECOND_NS))
            assert result.verdict is Verdict.SKIPPED_BELOW_MOTION_THRESHOLD
        assert np.array_equal(result.estimate.map_from_base, before)

    def test_each_laser_has_its_own_motion_filter(self, mapper):
        """Two lasers that fire at once: the second one's scans count, too."""
        poses = drive(6)
        rng = np.random.default_rng(7)
        for k, pose in enumerate(poses):
            mapper.add_odometry(k * SECOND_NS, pose)
            for base_from_laser in (FRONT, BACKWARDS):
                scan = scan_at(k * SECOND_NS, pose, rng, base_from_laser=base_from_laser)
                assert mapper.add_scan(scan).verdict is Verdict.PROCESSED

    def test_walls_are_occupied_and_the_floor_is_free(self, mapper):
        poses = drive(STEPS)
        feed(mapper, poses, drifting(poses))
        tiles = occupancy(mapper)
        values = np.concatenate([tile.ravel() for tile in tiles.values()])
        assert values.dtype == np.int8
        assert values.min() == -1
        assert values.max() <= 100
        cells = {}
        for (column, row), tile in tiles.items():
            for r, c in zip(*np.nonzero(tile >= 0), strict=True):
                cells[row + r, column + c] = tile[r, c]
        resolution_m = CONFIG.grid.resolution_meters
        for pose in poses:
            x, y, _ = se2.compose(pose, np.array((0.5, 0.0, 0.0)))
            assert cells[int(np.floor(y / resolution_m)), int(np.floor(x / resolution_m))] < 40
        occupied = np.array([cell for cell, value in cells.items() if value > 65])
        assert len(occupied) > 200
        y, x = (occupied.T + 0.5) * resolution_m
        away_m = np.full(len(occupied), np.inf)
        for (ax, ay), (bx, by) in ROOM:
            length = np.hypot(bx - ax, by - ay)
            ux, uy = (bx - ax) / length, (by - ay) / length
            t = np.clip((x - ax) * ux + (y - ay) * uy, 0.0, length)
            away_m = np.minimum(away_m, np.hypot(x - ax - t * ux, y - ay - t * uy))
        assert np.percentile(away_m, 95) < 0.1

    def test_the_estimate_ties_the_map_to_odometry(self, mapper):
        poses = drive(STEPS)
        odometry = drifting(poses)
        for result, reading in zip(feed(mapper, poses, odometry), odometry, strict=True):
            estimate = result.estimate
            tied = se2.compose(estimate.map_from_odom, reading)
            np.testing.assert_allclose(se2.between(estimate.map_from_base, tied), 0.0, atol=1e-9)
            np.testing.assert_allclose(estimate.covariance, estimate.covariance.T, atol=1e-12)
            assert np.linalg.eigvalsh(estimate.covariance).min() > -1e-12
            assert 1.0 - 1e-9 <= estimate.effective_sample_size <= CONFIG.particles + 1e-9
            assert estimate.particle_count == CONFIG.particles
        assert mapper.estimate() is estimate

    def test_the_map_starts_where_odometry_does(self, mapper):
        start = np.array((12.0, -7.0, 2.0))
        poses = drive(4)
        odometry = [se2.compose(start, se2.between(poses[0], pose)) for pose in poses]
        results = feed(mapper, poses, odometry)
        np.testing.assert_array_equal(results[0].estimate.map_from_base, start)
        for result, reading in zip(results, odometry, strict=True):
            away = se2.between(reading, result.estimate.map_from_base)
            assert np.abs(away).max() < 0.1

    def test_many_resamplings_do_no_harm(self, workers):
        config = replace(CONFIG, resampling=ResamplingConfig(threshold_ratio=1.0))
        mapper = Mapper(config, 1, workers, 2)
        poses = drive(STEPS)
        away_m, _ = errors(poses, feed(mapper, poses, drifting(poses)))
        assert away_m.max() < 0.1
        np.testing.assert_allclose(
            mapper.trajectory().map_from_base[-1], mapper.estimate().map_from_base, atol=1e-9
        )

    @pytest.mark.parametrize("coarse_factor", [2, 7, 16])
    def test_any_coarse_factor_finds_the_way(self, workers, coarse_factor):
        config = replace(CONFIG, grid=GridConfig(coarse_factor=coarse_factor), particles=3)
        mapper = Mapper(config, 1, workers, 2)
        poses = drive(10)
        away_m, _ = errors(poses, feed(mapper, poses, drifting(poses)))
        assert away_m.max() < 0.1


class TestScansOfEveryKind:
    @pytest.mark.parametrize("range_m", [np.nan, np.inf, -np.inf, 0.0, 20.0, 81.9])
    def test_no_returns_at_all(self, mapper, range_m):
        poses = drive(4)
        for k, pose in enumerate(poses):
            mapper.add_odometry(k * SECOND_NS, pose)
            result = mapper.add_scan(nothing_seen(k * SECOND_NS, range_m))
            assert result.verdict is Verdict.PROCESSED
            assert np.isfinite(result.estimate.map_from_base).all()
            assert result.estimate.effective_sample_size == pytest.approx(CONFIG.particles)
        assert not occupancy(mapper)

    def test_a_few_readings_that_are_not_numbers(self, mapper):
        poses, rng = drive(12), np.random.default_rng(3)
        results = []
        for k, (pose, reading) in enumerate(zip(poses, drifting(poses), strict=True)):
            scan = scan_at(k * SECOND_NS, pose, rng)
            scan.ranges_m[rng.random(181) < 0.2] = np.nan
            mapper.add_odometry(k * SECOND_NS, reading)
            results.append(mapper.add_scan(scan))
        away_m, _ = errors(poses, results)
        assert away_m.max() < 0.08

    @pytest.mark.parametrize("beams", [0, 1, 2])
    def test_hardly_any_beams(self, mapper, beams):
        poses = drive(6)
        results = feed(mapper, poses, poses, bearings_rad=np.linspace(0.0, 0.3, beams))
        assert all(result.verdict is Verdict.PROCESSED for result in results)
        assert all(np.isfinite(result.estimate.map_from_base).all() for result in results)
        values = list(occupancy(mapper).values())
        assert bool(values) == (beams > 0)

    def test_where_nothing_matches_the_motion_model_goes_on(self, workers):
        """Out of the room into the open: nothing to match, yet the robot drives on, ever less sure."""
        mapper = Mapper(replace(CONFIG, particles=20), 1, workers, 2)
        poses = drive(6)
        feed(mapper, poses, poses)
        known = mapper.estimate().covariance
        pose, spread = poses[-1], []
        for k in range(7, 19):
            pose = se2.compose(pose, np.array((0.5, 0.0, 0.0)))
            mapper.add_odometry(k * SECOND_NS, pose)
            result = mapper.add_scan(nothing_seen(k * SECOND_NS))
            assert result.verdict is Verdict.PROCESSED
            spread.append(np.sqrt(np.trace(result.estimate.covariance[:2, :2])))
        assert spread[-1] > spread[0] > np.sqrt(np.trace(known[:2, :2]))
        # 6 m by odometry alone: within what its noise adds up to.
        away = se2.between(pose, result.estimate.map_from_base)
        assert 0.001 < np.hypot(*away[:2]) < 2.5
        assert mapper.trajectory().processed.all()
