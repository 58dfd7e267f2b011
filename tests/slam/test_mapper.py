"""The mapper as a whole, in a small room."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest
from gridwright_server.config import (
    GridConfig,
    MapperConfig,
    MatchingConfig,
    MotionConfig,
    ProposalConfig,
    ResamplingConfig,
    SensorConfig,
)
from gridwright_server.slam import se2
from gridwright_server.slam.grid.tiles import NO_TILE
from gridwright_server.slam.mapper import REVERSAL_TOLERANCE_NS, Mapper
from gridwright_server.slam.types import Scan, Verdict
from naive.one_map import field_of
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

CONFIG = MapperConfig(particles=6)
STEPS = 30
BLURRED = SensorConfig(hit_sigma_meters=3.0)


@pytest.fixture(scope="module")
def workers():
    with ThreadPoolExecutor(4) as pool:
        yield pool


@pytest.fixture
def mapper(workers):
    return Mapper(CONFIG, 1, workers, 2)


def feed(mapper, poses, odometry, first=0, **how):
    """Drives along; returns each scan's result. Scan k is taken at second k."""
    rng = np.random.default_rng(7)
    results = []
    for k, (pose, reading) in enumerate(zip(poses, odometry, strict=True), start=first):
        assert mapper.add_odometry(k * SECOND_NS, reading) is Verdict.PROCESSED
        results.append(mapper.add_scan(scan_at(k * SECOND_NS, pose, rng, **how)))
    return results


def occupancy(mapper):
    """{(row, column) of a tile's first cell: its cells} of the map as known now."""
    snapshot = mapper.map_snapshot()
    tiles = {tuple(origin): snapshot.occupancy(k) for k, origin in enumerate(snapshot.tile_origins.tolist())}
    snapshot.close()
    return tiles


def fingerprint(mapper):
    trajectory, snapshot = mapper.trajectory(), mapper.map_snapshot()
    parts = [trajectory.map_from_base.tobytes(), trajectory.stamps_ns.tobytes()]
    parts += [snapshot.tile_origins.tobytes(), mapper.estimate().covariance.tobytes()]
    parts += [snapshot.occupancy(k).tobytes() for k in range(len(snapshot.tile_origins))]
    snapshot.close()
    return b"".join(parts)


def errors(poses, results):
    away = np.array(
        [
            se2.between(pose, result.estimate.map_from_base)
            for pose, result in zip(poses, results, strict=True)
        ]
    )
    return np.hypot(away[:, 0], away[:, 1]), np.abs(away[:, 2])


def nothing_seen(stamp_ns, range_m=np.inf):
    return Scan(stamp_ns, HALF_CIRCLE, np.full(len(HALF_CIRCLE), range_m), 0.05, 20.0, FRONT)


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


def run(workers, seed=5, threads=1, config=CONFIG, steps=STEPS, **how):
    """Everything that comes out of one drive, as bytes."""
    mapper = Mapper(config, seed, workers, threads)
    poses = drive(steps)
    results = feed(mapper, poses, drifting(poses), **how)
    return fingerprint(mapper), [result.estimate.map_from_base.tobytes() for result in results]


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


class TestVerdicts:
    def test_before_any_odometry(self, mapper):
        rng = np.random.default_rng(1)
        result = mapper.add_scan(scan_at(0, np.zeros(3), rng))
        assert (result.verdict, result.estimate) == (Verdict.REJECTED_NO_ODOMETRY, None)
        assert mapper.estimate() is None
        assert mapper.map_snapshot() is None
        assert len(mapper.trajectory().stamps_ns) == 0
        mapper.add_odometry(0, np.zeros(3))
        assert mapper.add_scan(scan_at(1, np.zeros(3), rng)).verdict is Verdict.PROCESSED
        assert mapper.map_snapshot().revision == 1

    def test_below_the_motion_threshold(self, mapper):
        poses = drive(12, step=(0.07, 0.0, 0.0))
        results = feed(mapper, poses, poses)
        verdicts = [result.verdict for result in results]
        assert verdicts[0] is verdicts[3] is Verdict.PROCESSED
        assert verdicts[1] is verdicts[2] is Verdict.SKIPPED_BELOW_MOTION_THRESHOLD
        # A skipped scan is answered and remembered all the same.
        away_m, _ = errors(poses, results)
        assert away_m.max() < 0.08
        trajectory = mapper.trajectory()
        assert trajectory.processed.tolist() == [verdict is Verdict.PROCESSED for verdict in verdicts]
        assert trajectory.stamps_ns.tolist() == [k * SECOND_NS for k in range(13)]
        snapshot = mapper.map_snapshot()
        assert snapshot.revision == trajectory.processed.sum()
        assert snapshot.stamp_ns == 12 * SECOND_NS
        snapshot.close()

    def test_turning_on_the_spot_is_motion(self, mapper):
        poses = drive(3, step=(0.0, 0.0, 0.25))
        assert [result.verdict for result in feed(mapper, poses, poses)] == [Verdict.PROCESSED] * 4

    def test_a_clock_that_steps_back(self, mapper):
        poses = drive(8)
        feed(mapper, poses, poses)
        newest_ns, rng = 8 * SECOND_NS, np.random.default_rng(1)
        oldest_ns = newest_ns - REVERSAL_TOLERANCE_NS
        before = fingerprint(mapper)
        assert mapper.add_scan(scan_at(oldest_ns - 1, poses[-1], rng)).verdict is (
            Verdict.REJECTED_OUT_OF_ORDER
        )
        assert mapper.add_odometry(oldest_ns - 1, poses[-1]) is Verdict.REJECTED_OUT_OF_ORDER
        assert fingerprint(mapper) == before
        beyond = se2.compose(poses[-1], np.array((0.21, 0.0, 0.21)))
        assert mapper.add_odometry(oldest_ns, beyond) is Verdict.PROCESSED
        result = mapper.add_scan(scan_at(oldest_ns, beyond, rng))
        assert result.verdict is Verdict.PROCESSED
        assert np.abs(se2.between(beyond, result.estimate.map_from_base)).max() < 0.1
        assert mapper.trajectory().stamps_ns[-1] == oldest_ns

    def test_odometry_that_jumps_out_of_the_map_and_returns(self, mapper):
        poses = drive(16)
        odometry = drifting(poses)
        feed(mapper, poses[:8], odometry[:8])
        before, estimate = fingerprint(mapper), mapper.estimate()
        jumped = se2.compose(np.array((10_000.0, 0.0, 0.0)), odometry[8])
        [result] = feed(mapper, [poses[8]], [jumped], first=8)
        assert (result.verdict, result.estimate) == (Verdict.REJECTED_OUTSIDE_MAP, None)
        assert mapper.estimate() is estimate
        assert fingerprint(mapper) == before
        results = feed(mapper, poses[9:], odometry[9:], first=9)
        assert all(result.verdict is Verdict.PROCESSED for result in results)
        away_m, _ = errors(poses[9:], results)
        assert away_m.max() < 0.1
        assert len(mapper.trajectory().stamps_ns) == 16


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


class TestSnapshots:
    def test_later_scans_do_not_change_one(self, mapper):
        poses = drive(STEPS)
        odometry = drifting(poses)
        feed(mapper, poses[:6], odometry[:6])
        kept = []
        for k in range(6, STEPS, 4):
            snapshot = mapper.map_snapshot()
            kept.append((snapshot, [snapshot.occupancy(tile) for tile in range(len(snapshot.tile_origins))]))
            feed(mapper, poses[k : k + 4], odometry[k : k + 4], first=k)
        for snapshot, before in kept:
            for tile, expected in enumerate(before):
                np.testing.assert_array_equal(snapshot.occupancy(tile), expected)
        revisions = [snapshot.revision for snapshot, _ in kept]
        assert revisions == sorted(set(revisions))
        for snapshot, _ in kept:
            snapshot.close()
            snapshot.close()
            with pytest.raises(ValueError, match="closed"):
                snapshot.occupancy(0)

    def test_an_open_one_changes_no_result(self, workers):
        poses = drive(12)
        odometry = drifting(poses)
        plain, watched = (Mapper(CONFIG, 1, workers, 2) for _ in range(2))
        feed(plain, poses, odometry)
        for k in range(13):
            feed(watched, poses[k : k + 1], odometry[k : k + 1], first=k)
            snapshot = watched.map_snapshot()
            if k % 3 == 0:
                snapshot.close()
        # The measuring noise starts anew with each call of feed: give the other one the same.
        again = Mapper(CONFIG, 1, workers, 2)
        for k in range(13):
            feed(again, poses[k : k + 1], odometry[k : k + 1], first=k)
        assert fingerprint(watched) == fingerprint(again)
        assert len(fingerprint(plain)) > 0


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
