"""The odometry pose at a scan's time."""

import itertools
import math

import numpy as np
import pytest
from gridwright_server.slam import se2
from gridwright_server.slam.odometry import EXTRAPOLATION_LIMIT_NS, HISTORY, OdometryBuffer
from hypothesis import given, settings
from hypothesis import strategies as st

MS = 1_000_000


def on_circle(stamp_ns, radius=3.0, speed_rad=0.3):
    turn = speed_rad * stamp_ns * 1e-9
    return np.array([radius * math.sin(turn), radius * (1.0 - math.cos(turn)), se2.wrap(turn)])


def buffer_of(*readings):
    buffer = OdometryBuffer()
    for stamp_ns, pose in readings:
        buffer.add(stamp_ns, np.array(pose, np.float64))
    return buffer


def assert_close(actual, expected):
    np.testing.assert_allclose(se2.between(np.array(expected, np.float64), actual), 0.0, atol=1e-8)


@settings(deadline=None)
@given(st.lists(st.integers(0, 8000), min_size=2, max_size=20, unique=True).map(sorted), st.data())
def test_between_readings_a_robot_stays_on_its_circle(stamps_ms, data):
    buffer = buffer_of(*((ms * MS, on_circle(ms * MS)) for ms in stamps_ms))
    at_ns = data.draw(st.integers(stamps_ms[0] * MS, stamps_ms[-1] * MS))
    assert_close(buffer.at(at_ns), on_circle(at_ns))


@settings(deadline=None)
@given(
    st.lists(st.integers(0, 100).map(lambda k: 80 * k), min_size=2, max_size=20, unique=True).map(sorted),
    st.integers(0, 2_000_000_000),
)
def test_beyond_the_newest_it_goes_on_as_before_but_not_for_long(stamps_ms, ahead_ns):
    buffer = buffer_of(*((ms * MS, on_circle(ms * MS)) for ms in stamps_ms))
    newest_ns = stamps_ms[-1] * MS
    assert_close(
        buffer.at(newest_ns + ahead_ns), on_circle(newest_ns + min(ahead_ns, EXTRAPOLATION_LIMIT_NS))
    )


@settings(deadline=None)
@given(st.lists(st.integers(0, 8000), min_size=1, max_size=20, unique=True).map(sorted), st.data())
def test_at_a_readings_own_stamp_it_is_that_reading(stamps_ms, data):
    buffer = buffer_of(*((ms * MS, on_circle(ms * MS)) for ms in stamps_ms))
    stamp_ns = data.draw(st.sampled_from(stamps_ms)) * MS
    assert_close(buffer.at(stamp_ns), on_circle(stamp_ns))
    assert np.array_equal(buffer.at(stamps_ms[-1] * MS), on_circle(stamps_ms[-1] * MS))


def test_before_the_oldest_it_stood_there():
    buffer = buffer_of((1000 * MS, (1, 2, 0.5)), (1100 * MS, (2, 2, 0.5)))
    assert_close(buffer.at(999 * MS), (1, 2, 0.5))
    assert_close(buffer.at(0), (1, 2, 0.5))


def test_a_single_reading_is_all_there_is_to_know():
    buffer = buffer_of((1000 * MS, (1, 2, 0.5)))
    for stamp_ns in (0, 1000 * MS, 5000 * MS):
        assert_close(buffer.at(stamp_ns), (1, 2, 0.5))


def test_of_two_readings_of_one_time_the_newer_counts():
    buffer = buffer_of((0, (0, 0, 0)), (100 * MS, (1, 0, 0)), (100 * MS, (2, 0, 0)))
    assert_close(buffer.at(100 * MS), (2, 0, 0))


def test_speed_is_not_told_by_the_readings_of_a_burst():
    """A millimetre of jitter within a millisecond is no metre a second."""
    buffer = buffer_of((0, (0, 0, 0)), (100 * MS, (0.1, 0, 0)), (101 * MS, (0.102, 0, 0)))
    assert_close(buffer.at(201 * MS), (0.102 + 0.102 * 100 / 101, 0, 0))


def test_where_clocks_step_back_the_newest_pair_around_the_time_counts():
    buffer = buffer_of((0, (0, 0, 0)), (100 * MS, (1, 0, 0)), (50 * MS, (1.2, 0, 0)), (150 * MS, (2.2, 0, 0)))
    assert_close(buffer.at(75 * MS), (1.45, 0, 0))
    assert_close(buffer.at(25 * MS), (0.25, 0, 0))


def test_within_a_step_back_the_pose_lies_between_the_two_readings():
    buffer = buffer_of((0, (0, 0, 0)), (100 * MS, (1, 0, 0)), (60 * MS, (1.4, 0, 0)))
    assert_close(buffer.at(80 * MS), (1.2, 0, 0))


@pytest.mark.parametrize("step_back_ms", [1, 10, 300])
def test_after_a_step_back_nobody_drives_backwards(step_back_ms):
    """The speed is that since a reading that the clock, too, puts before the newest."""
    buffer = buffer_of((0, (0, 0, 0)), (1000 * MS, (1, 0, 0)), ((1000 - step_back_ms) * MS, (1.05, 0, 0)))
    assert 1.05 < buffer.at(1100 * MS)[0] < 1.5


@settings(deadline=None)
@given(st.lists(st.integers(0, 30), min_size=2, max_size=12), st.integers(0, 30))
def test_any_order_of_stamps_agrees_with_looking_at_every_pair(stamps_ms, at_ms):
    readings = [(ms * MS, np.array((float(k), 0.0, 0.0))) for k, ms in enumerate(stamps_ms)]
    spans = list(itertools.pairwise(stamps_ms))
    around = [k for k, (a, b) in enumerate(spans) if min(a, b) <= at_ms <= max(a, b)]
    actual = buffer_of(*readings).at(at_ms * MS)
    if around and at_ms <= max(stamps_ms[-2:]):  # else it is beyond the newest
        a, b = spans[around[-1]]
        expected = around[-1] + ((at_ms - a) / (b - a) if a != b else 1.0)
        assert actual[0] == pytest.approx(expected, abs=1e-9)


def test_a_reading_long_gone_is_forgotten():
    buffer = buffer_of(*((k * MS, (k, 0, 0)) for k in range(HISTORY + 10)))
    assert len(buffer) == HISTORY
    assert_close(buffer.at(0), (10, 0, 0))
    assert_close(buffer.at(12 * MS), (12, 0, 0))
