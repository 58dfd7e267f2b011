"""The pose of every scan along a path of updates."""

import numpy as np
import pytest
from gridwright_server.slam import se2
from gridwright_server.slam.scans import ScanRecord


def test_a_processed_scan_has_its_updates_pose():
    record = ScanRecord()
    for update in range(5):
        record.append(update, np.array((update, 0.0, 0.0)), update, True)
    path = np.random.default_rng(1).normal(size=(5, 3))
    trajectory = record.along_path(path)
    np.testing.assert_allclose(trajectory.map_from_base, path, atol=1e-12)
    assert trajectory.processed.all()
    assert trajectory.stamps_ns.tolist() == [0, 1, 2, 3, 4]


def test_a_skipped_scan_lies_on_the_way_by_odometry():
    record = ScanRecord()
    odometry = [(0, 0, 0), (1, 0, 0), (2, 0, 0.5), (4, 0, 0)]
    for k, pose in enumerate(odometry):
        record.append(k, np.array(pose, np.float64), 0 if k < 3 else 1, k in (0, 3))
    # Odometry is right: between the updates the robot was where odometry says.
    start = np.array((10.0, 5.0, np.pi / 2))
    path = np.array([se2.compose(start, np.array(pose, np.float64)) for pose in (odometry[0], odometry[3])])
    poses = record.along_path(path).map_from_base
    for pose, expected in zip(poses, odometry, strict=True):
        np.testing.assert_allclose(
            se2.between(se2.compose(start, np.array(expected, np.float64)), pose), 0.0, atol=1e-9
        )
    assert record.along_path(path).processed.tolist() == [True, False, False, True]


def test_what_odometry_missed_is_spread_over_the_way():
    """Odometry says 4 m straight on; the matches say 4 m and 0.4 m to the left."""
    record = ScanRecord()
    for k in range(5):
        record.append(k, np.array((float(k), 0.0, 0.0)), 0 if k < 4 else 1, k in (0, 4))
    poses = record.along_path(np.array([(0.0, 0.0, 0.0), (4.0, 0.4, 0.0)])).map_from_base
    np.testing.assert_allclose(poses[:, 0], [0, 1, 2, 3, 4], atol=1e-12)
    np.testing.assert_allclose(poses[:, 1], [0, 0.1, 0.2, 0.3, 0.4], atol=1e-12)


@pytest.mark.parametrize("seed", range(5))
def test_the_bend_meets_the_next_update(seed):
    """A skipped scan just before an update gets that update's pose, whatever odometry missed."""
    rng = np.random.default_rng(seed)
    first, second = rng.normal(size=(2, 3))
    record = ScanRecord()
    record.append(0, first, 0, True)
    record.append(1, first, 0, False)
    record.append(2, second, 0, False)
    record.append(3, second, 1, True)
    path = rng.normal(size=(2, 3))
    poses = record.along_path(path).map_from_base
    np.testing.assert_allclose(se2.between(poses[1], poses[0]), 0.0, atol=1e-9)
    np.testing.assert_allclose(se2.between(poses[2], poses[3]), 0.0, atol=1e-9)


def test_after_the_last_update_odometry_goes_on():
    record = ScanRecord()
    record.append(0, np.zeros(3), 0, True)
    record.append(1, np.array((1.0, 0.0, 0.2)), 0, False)
    poses = record.along_path(np.array([(3.0, 4.0, np.pi / 2)])).map_from_base
    np.testing.assert_allclose(poses[1], (3.0, 5.0, np.pi / 2 + 0.2))


def test_a_turn_on_the_spot_is_a_way_too():
    record = ScanRecord()
    for k, angle in enumerate((0.0, 0.2, 0.4)):
        record.append(k, np.array((0.0, 0.0, angle)), 0 if k < 2 else 1, k != 1)
    poses = record.along_path(np.array([(0.0, 0.0, 0.0), (0.1, 0.0, 0.4)])).map_from_base
    assert poses[1, 2] == pytest.approx(0.2)
    assert np.hypot(*poses[1, :2]) == pytest.approx(0.05, abs=1e-3)


def test_a_robot_that_stood_still_makes_no_numbers_up():
    record = ScanRecord()
    for k in range(3):
        record.append(k, np.ones(3), 0 if k < 2 else 1, k != 1)
    poses = record.along_path(np.array([(0.0, 0.0, 0.0), (0.1, 0.0, 0.0)])).map_from_base
    np.testing.assert_allclose(poses[1], 0.0, atol=1e-12)


def test_it_keeps_more_than_it_first_made_room_for():
    record = ScanRecord()
    count = 5000
    for k in range(count):
        record.append(10 * k, np.array((0.1 * k, 0.0, 0.0)), k // 5, k % 5 == 0)
    path = np.array([(0.5 * u, 0.0, 0.0) for u in range(count // 5)])
    trajectory = record.along_path(path)
    assert trajectory.stamps_ns.tolist() == [10 * k for k in range(count)]
    np.testing.assert_allclose(trajectory.map_from_base[:, 0], 0.1 * np.arange(count), atol=1e-9)
    assert trajectory.processed.tolist() == [k % 5 == 0 for k in range(count)]


def test_a_trajectory_is_not_changed_by_later_scans():
    record = ScanRecord()
    record.append(0, np.zeros(3), 0, True)
    before = record.along_path(np.zeros((1, 3)))
    record.append(1, np.ones(3), 1, True)
    assert before.stamps_ns.tolist() == [0]
    assert len(before.map_from_base) == 1
