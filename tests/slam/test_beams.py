"""Which readings are returns, and where their end points are."""

import numpy as np
import pytest
from gridwright_server.slam.beams import beams_of
from gridwright_server.slam.types import Scan
from hypothesis import given, settings
from hypothesis import strategies as st
from naive.homogeneous import matrix

MIN_M, MAX_M = 0.5, 10.0


def scan_of(ranges_m, base_from_laser=(0.0, 0.0, 0.0), first=-1.0, step=0.1):
    ranges_m = np.array(ranges_m, np.float64)
    return Scan(0, first + step * np.arange(len(ranges_m)), ranges_m, MIN_M, MAX_M, np.array(base_from_laser))


@pytest.mark.parametrize(
    ("range_m", "is_return"),
    [
        (np.nan, False),
        (np.inf, False),
        (-np.inf, False),
        (-1.0, False),
        (0.0, False),
        (np.nextafter(MIN_M, 0.0), False),
        (MIN_M, True),
        (3.0, True),
        (np.nextafter(MAX_M, 0.0), True),
        (MAX_M, False),
        (81.9, False),
    ],
)
def test_what_counts_as_a_return(range_m, is_return):
    beams = beams_of(scan_of([1.0, range_m, 2.0]), 100.0)
    assert beams.ranges_m.tolist() == [1.0, range_m if is_return else 0.0, 2.0]
    assert len(beams.points) == 2 + is_return


def test_zero_is_no_return_even_where_the_sensor_allows_it():
    scan = Scan(0, np.zeros(1), np.zeros(1), 0.0, MAX_M, np.zeros(3))
    assert len(beams_of(scan, 100.0).points) == 0


def test_beyond_the_usable_range_is_no_return():
    beams = beams_of(scan_of([3.9, 4.0, 5.0]), 4.0)
    assert beams.ranges_m.tolist() == [3.9, 0.0, 0.0]


@settings(deadline=None)
@given(
    st.lists(st.one_of(st.floats(MIN_M, 9.9), st.sampled_from([np.nan, np.inf, 0.1, MAX_M])), max_size=30),
    st.tuples(st.floats(-1, 1), st.floats(-1, 1), st.floats(-4, 4)),
)
def test_end_points_are_the_lasers_moved_to_where_it_is_mounted(ranges_m, base_from_laser):
    scan = scan_of(ranges_m, base_from_laser)
    beams = beams_of(scan, 100.0)
    expected = []
    for bearing, range_m in zip(scan.bearings_rad, scan.ranges_m, strict=True):
        if np.isfinite(range_m) and MIN_M <= range_m < MAX_M:
            in_laser = (range_m * np.cos(bearing), range_m * np.sin(bearing), 1.0)
            expected.append((matrix(base_from_laser) @ in_laser)[:2])
    expected = np.array(expected).reshape(-1, 2)
    np.testing.assert_allclose(beams.points, expected, atol=1e-9)
    np.testing.assert_allclose(beams.laser, base_from_laser[:2])
    farthest = np.linalg.norm(expected, axis=1).max() if len(expected) else 0.0
    assert beams.reach_m == pytest.approx(farthest)
    # Bearing and range, from where the laser is, lead to the same points.
    is_return = beams.ranges_m > 0.0
    directions = np.stack([np.cos(beams.bearings_rad), np.sin(beams.bearings_rad)], axis=1)[is_return]
    np.testing.assert_allclose(
        beams.laser + beams.ranges_m[is_return, None] * directions, expected, atol=1e-9
    )


@pytest.mark.parametrize("ranges_m", [[], [np.nan] * 5, [MAX_M] * 5])
def test_a_scan_that_hit_nothing(ranges_m):
    beams = beams_of(scan_of(ranges_m, (0.2, 0.1, 3.0)), 100.0)
    assert beams.points.shape == (0, 2)
    assert beams.reach_m == 0.0
    assert not beams.ranges_m.any()
    assert len(beams.bearings_rad) == len(ranges_m)
