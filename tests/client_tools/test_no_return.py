"""Which ranges mean that nothing came back."""

import numpy as np
import pytest
from carmen_lines import flaser, robotlaser, write
from gridwright_client.carmen import read_log
from gridwright_client.carmen.saturation import no_return_limit_m


def building(seed=0, sweeps=50, reach_m=25.0):
    """Sweeps whose ranges thin out towards the largest, as in buildings."""
    rng = np.random.default_rng(seed)
    return [np.float32(np.round(reach_m * rng.beta(1.2, 4.0, 180), 2)) for _ in range(sweeps)]


def with_shelf(values, share=0.03, **options):
    rng = np.random.default_rng(9)
    sweeps = building(**options)
    for sweep in sweeps:
        lost = rng.random(180) < share
        sweep[lost] = rng.choice(np.float32(values), lost.sum())
    return sweeps


@pytest.mark.parametrize("value", [81.83, 81.91, 51.16, 50.0, 30.0, 29.99])
def test_a_saturation_value_is_found(value):
    limit_m = no_return_limit_m(with_shelf([value]), None)
    assert np.float32(value) >= np.float32(limit_m)
    assert limit_m > 25.0


def test_the_values_of_a_shelf_all_mean_no_return():
    limit_m = no_return_limit_m(with_shelf([51.16, 51.12, 51.06, 51.05]), None)
    assert 51.0 < limit_m <= 51.05 + 1e-5


def test_a_short_reach_into_a_large_hall_is_found():
    sweeps = [np.minimum(sweep, np.float32(8.0)) for sweep in building(reach_m=40.0)]
    assert no_return_limit_m(sweeps, None) == pytest.approx(8.0, rel=0.005)


def test_the_farthest_wall_is_no_shelf():
    assert no_return_limit_m(building(), None) == 80.0


def test_a_named_maximum_counts():
    assert no_return_limit_m(building(), 12.0) == 12.0


def test_a_shelf_below_the_named_maximum_counts_more():
    assert no_return_limit_m(with_shelf([81.83]), 81.91) == pytest.approx(81.83)


@pytest.mark.parametrize("maximum_m", [0.0, -1.0, None])
def test_a_maximum_that_makes_no_sense_is_passed_over(maximum_m):
    assert no_return_limit_m(building(), maximum_m) == 80.0


def test_a_log_of_few_sweeps_is_taken_as_it_is():
    assert no_return_limit_m([np.full(180, 5.0, np.float32)] * 3, None) == 80.0


def test_sweeps_without_numbers_are_no_error():
    assert no_return_limit_m([np.full(4, np.nan, np.float32), np.zeros(0, np.float32)], None) == 80.0
    assert no_return_limit_m([], 5.0) == 5.0


def test_the_maximum_itself_is_no_return_whatever_float32_makes_of_it(tmp_path):
    lines = ["PARAM robot_front_laser_max 51.16 nohost 0", flaser([51.15, 51.16, 51.17, "nan"])]
    (scan,) = read_log(write(tmp_path / "made.clf", lines)).scans
    assert np.isinf(scan.ranges_m).tolist() == [False, True, True, False]
    assert scan.range_max_m == 51.16


def test_robot_lasers_name_their_maximum(tmp_path):
    (scan,) = read_log(write(tmp_path / "made.clf", [robotlaser([5.0, 20.0, 21.0])])).scans
    assert np.isinf(scan.ranges_m).tolist() == [False, True, True]


def no_returns(path):
    log = read_log(path)
    ranges_m = np.concatenate([scan.ranges_m for scan in log.scans])
    return int(np.isinf(ranges_m).sum()), float(ranges_m[np.isfinite(ranges_m)].max())


@pytest.mark.real_log
def test_intel(recorded_logs):
    assert no_returns(recorded_logs / "intel" / "intel.clf") == (20947, pytest.approx(26.23))


@pytest.mark.real_log
def test_killian_court(recorded_logs):
    assert no_returns(recorded_logs / "mit-killian" / "mit-killian.clf") == (4660, pytest.approx(50.86))


@pytest.mark.real_log
def test_aces(recorded_logs):
    count, largest_m = no_returns(recorded_logs / "aces" / "aces.clf")
    assert count >= 620
    assert largest_m < 50.0
