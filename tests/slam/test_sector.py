"""Which cells a scan saw free."""

import math

import numpy as np
import pytest
from gridwright_server.slam.grid.sector import fill_runs, sector_outline
from hypothesis import given, settings
from hypothesis import strategies as st
from naive.polygon import cells_inside, winding_numbers

MARGIN_M = 0.04
ORIGIN = np.zeros(2)


def cells_of(runs):
    return [(int(row), column) for row, first, beyond in runs for column in range(first, beyond)]


def star(rng, field_of_view_rad, clockwise):
    """A scan's outline in cells: no-return beams, steps in range, a place of its own."""
    beams = int(rng.integers(1, 60))
    bearings = np.linspace(0.0, field_of_view_rad, beams) + rng.uniform(-4.0, 4.0)
    ranges = rng.uniform(0.0, 20.0, beams) * (rng.random(beams) > 0.2)
    outline = sector_outline(bearings[:: -1 if clockwise else 1].copy(), ranges, 0.5, rng.normal(size=2))
    offset = rng.uniform(-30.0, 30.0, 2)
    return outline[:, 0] + offset[0], outline[:, 1] + offset[1]


@pytest.mark.parametrize("clockwise", [False, True])
@pytest.mark.parametrize("degrees", [90, 180, 270, 359, 360, 450])
@pytest.mark.parametrize("seed", range(5))
def test_a_filled_star_has_the_cells_that_it_goes_around(degrees, clockwise, seed):
    columns, rows = star(np.random.default_rng([seed, degrees]), math.radians(degrees), clockwise)
    runs = fill_runs(columns, rows)
    cells = cells_of(runs)
    assert len(cells) == len(set(cells))
    assert set(cells) == cells_inside(columns, rows)
    assert (runs[:, 1] < runs[:, 2]).all()
    assert [tuple(run) for run in runs[:, :2]] == sorted(tuple(run) for run in runs[:, :2])


@settings(deadline=None, max_examples=60)
@given(st.integers(0, 2**32 - 1), st.integers(3, 12))
def test_any_polygon_is_filled_once_even_where_it_crosses_itself(seed, corners):
    columns, rows = np.random.default_rng(seed).uniform(-12.0, 12.0, (2, corners))
    cells = cells_of(fill_runs(columns, rows))
    assert len(cells) == len(set(cells))
    assert set(cells) == cells_inside(columns, rows)


def test_polygons_side_by_side_share_no_cell_and_miss_none():
    """Corners on the centres of cells: who owns the border is decided alike for both."""
    left = fill_runs(np.array([0.5, 5.5, 5.5, 0.5]), np.array([0.5, 0.5, 6.5, 6.5]))
    right = fill_runs(np.array([5.5, 9.5, 9.5, 5.5]), np.array([0.5, 0.5, 6.5, 6.5]))
    both = cells_of(left) + cells_of(right)
    assert len(both) == len(set(both)) == 9 * 6


def test_a_point_holds_no_cell():
    assert len(fill_runs(np.full(1, 3.3), np.full(1, 2.2))) == 0
    assert len(fill_runs(np.full(7, 3.5), np.full(7, 2.5))) == 0


def distance_to_wall(bearings, wall_m, wall_rad):
    """Range to a straight wall whose nearest point is wall_m away in direction wall_rad."""
    return wall_m / np.cos(bearings - wall_rad)


@pytest.mark.parametrize("seed", range(10))
def test_in_front_of_a_wall_is_free_and_behind_it_nothing(seed):
    rng = np.random.default_rng(seed)
    resolution_m, wall_m, wall_rad = 0.04, rng.uniform(0.5, 4.0), rng.uniform(-3.0, 3.0)
    bearings = wall_rad + np.radians(np.arange(-60.0, 60.5, 1.0))
    ranges = distance_to_wall(bearings, wall_m, wall_rad)
    laser = rng.uniform(-1.0, 1.0, 2)
    outline = sector_outline(bearings, ranges, MARGIN_M, laser) / resolution_m
    free = np.array(cells_of(fill_runs(outline[:, 0], outline[:, 1])))
    ahead = (free[:, ::-1] + 0.5) * resolution_m - laser
    normal = np.array((math.cos(wall_rad), math.sin(wall_rad)))
    assert (ahead @ normal < wall_m).all()
    # And every cell that lies well within the fan and well in front of the wall is among them.
    side = np.arange(-250, 250)
    rows, columns = (grid.ravel() for grid in np.meshgrid(side, side, indexing="ij"))
    x, y = (columns + 0.5) * resolution_m - laser[0], (rows + 0.5) * resolution_m - laser[1]
    angle = np.remainder(np.arctan2(y, x) - wall_rad + math.pi, 2.0 * math.pi) - math.pi
    limit = wall_m / np.maximum(np.cos(angle), 0.1) - MARGIN_M - 0.02
    surely = (np.abs(angle) < math.radians(59.5)) & (np.hypot(x, y) < limit)
    assert surely.sum() > 100
    assert set(zip(rows[surely], columns[surely], strict=True)) <= {tuple(cell) for cell in free}


@pytest.mark.parametrize("seed", range(10))
def test_what_is_free_lies_before_the_return_of_its_own_beam(seed):
    """A beam without return frees nothing; one with a return nothing behind it."""
    rng = np.random.default_rng(seed)
    step = math.radians(3.0)
    bearings = step * np.arange(-40, 41)
    ranges = rng.uniform(0.5, 5.0, 81) * (rng.random(81) > 0.4)
    outline = sector_outline(bearings, ranges, MARGIN_M, ORIGIN)
    points = rng.uniform(-5.0, 5.0, (4000, 2))
    free = winding_numbers(points[:, 0], points[:, 1], outline[:, 0], outline[:, 1]) != 0
    assert free.sum() > 50
    for x, y in points[free]:
        beam = round(math.atan2(y, x) / step) + 40
        assert 0 <= beam < 81
        assert ranges[beam] > 0.0
        # Its border may reach half-way to a neighbour on the same surface.
        assert math.hypot(x, y) <= ranges[beam] - MARGIN_M + 0.15


def test_beside_a_gap_nothing_reaches_into_it():
    """A step in range: each side ends at its own return, so no line is drawn through the gap."""
    bearings = np.radians([-1.0, 0.0, 1.0, 2.0])
    outline = sector_outline(bearings, np.array([1.0, 1.0, 5.0, 5.0]), 0.0, ORIGIN)
    reach = np.hypot(outline[1:, 0], outline[1:, 1])
    np.testing.assert_allclose(reach, [1, 1, 1, 1, 5, 5, 5, 5])


@pytest.mark.parametrize("ranges", [[], [0.0], [0.0] * 5, [0.02] * 5])
def test_nothing_seen_frees_nothing(ranges):
    bearings = np.linspace(-1.0, 1.0, len(ranges))
    outline = sector_outline(bearings, np.array(ranges, np.float64), MARGIN_M, np.array((0.3, -0.2)))
    assert outline.shape == (2 * len(ranges) + 1, 2)
    assert len(fill_runs(outline[:, 0] / 0.01, outline[:, 1] / 0.01)) == 0


def test_one_beam_alone_has_no_width():
    outline = sector_outline(np.array([0.3]), np.array([4.0]), MARGIN_M, ORIGIN)
    assert len(fill_runs(outline[:, 0] / 0.01, outline[:, 1] / 0.01)) == 0


def test_the_outermost_beams_are_as_wide_as_the_others():
    outline = sector_outline(np.array([0.0, 0.1, 0.2]), np.full(3, 2.0), 0.0, ORIGIN)
    bearings = np.arctan2(outline[1:, 1], outline[1:, 0])
    np.testing.assert_allclose(bearings, [-0.05, 0.05, 0.05, 0.15, 0.15, 0.25], atol=1e-12)
