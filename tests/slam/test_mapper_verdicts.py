"""What the mapper says of each item, and what its snapshots hold."""

import numpy as np
import pytest
from gridwright_server.slam import se2
from gridwright_server.slam.mapper import REVERSAL_TOLERANCE_NS, Mapper
from gridwright_server.slam.types import Verdict
from mapped_room import CONFIG, STEPS, errors, feed, fingerprint
from simulated_room import (
    SECOND_NS,
    drifting,
    drive,
    scan_at,
)


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
