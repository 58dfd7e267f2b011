"""The two-level search: its bound, its exactness, and that it is worth it."""

import itertools

import numpy as np
import pytest
from gridwright_server.slam.grid.patch import CoarseLevel, reachable_maximum
from gridwright_server.slam.matching import multilevel
from gridwright_server.slam.matching.multilevel import Objective, Window, search
from naive.exhaustive_search import best_pose, reachable
from naive.one_map import block_maxima, field_of

RESOLUTION_M = 0.1
FACTORS = [
    (coarse, quarter, block)
    for coarse in range(2, 13)
    for quarter in {coarse, coarse // 2 if coarse % 2 == 0 else coarse}
    for block in range(1, 7)
    if quarter % block == 0
]


def random_field(rng, side):
    """Noise of few levels (many equal scores), single peaks, or walls with their fall-off."""
    kind = rng.integers(3)
    if kind == 0:
        return rng.integers(0, 4, (side, side)).astype(np.uint8)
    if kind == 1:
        return np.where(rng.random((side, side)) < 0.02, 255, 0).astype(np.uint8)
    return room_field(side, *sorted(rng.integers(side // 4, 3 * side // 4, 2)))


def room_field(side, low, high, outlier=0.05):
    along = range(side // 4, 3 * side // 4)
    walls = [(low, k) for k in along] + [(high, k) for k in along] + [(k, side // 4) for k in along]
    cells = np.arange(side)
    return field_of(walls, cells, cells, RESOLUTION_M, 0.15, outlier).astype(np.uint8)


def coarse_level(field, block, coarse, quarter):
    blocks = block_maxima(field, block).astype(np.uint8)
    level = CoarseLevel(block, np.zeros_like(blocks), np.zeros_like(blocks))
    scratch = np.zeros_like(blocks)
    reachable_maximum(blocks, block, coarse, scratch, level.voxel)
    reachable_maximum(blocks, block, quarter, scratch, level.quarter)
    return level


@pytest.mark.parametrize(("coarse", "quarter", "block"), FACTORS)
def test_the_bound_is_never_below_a_score_inside(coarse, quarter, block):
    """For voxels and quarters anywhere: every pose inside scores at most what its square promises."""
    rng = np.random.default_rng([coarse, quarter, block])
    side = block * (120 // block)
    promised_more = 0
    for _ in range(12):
        field = random_field(rng, side)
        level = coarse_level(field, block, coarse, quarter)
        beams, squares = int(rng.integers(1, 25)), 3
        free = side - squares * coarse - coarse - 2 * block - 20
        rows, columns = rng.integers(0, free, (2, beams)).astype(np.int32)
        row0, column0 = (int(k) * coarse for k in rng.integers(0, 1 + 20 // coarse, 2))
        for maxima, square in ((level.voxel, coarse), (level.quarter, quarter)):
            sums = np.empty((squares, squares), np.int32)
            multilevel._coarse_sums(maxima, block, rows, columns, row0, column0, square, sums)
            fine = np.empty((square, square), np.int32)
            for i, j in itertools.product(range(squares), repeat=2):
                multilevel.score_square(field, rows, columns, row0 + i * square, column0 + j * square, fine)
                for a, b in itertools.product(range(square), repeat=2):
                    at = (rows + row0 + i * square + a, columns + column0 + j * square + b)
                    assert fine[a, b] == field[at].astype(int).sum()
                assert sums[i, j] >= fine.max()
                promised_more += sums[i, j] > fine.max()
    assert promised_more or coarse <= 2  # else it would not be the bound that was tested


@pytest.mark.parametrize(("coarse", "quarter", "block"), FACTORS)
def test_the_coarse_level_holds_the_maximum_of_what_is_in_reach(coarse, quarter, block):
    rng = np.random.default_rng([coarse, quarter, block, 1])
    side = block * (48 // block)
    field = rng.integers(0, 255, (side, side)).astype(np.uint8)
    level = coarse_level(field, block, coarse, quarter)
    for maxima, square in ((level.voxel, coarse), (level.quarter, quarter)):
        inside = side // block - (block + square - 2) // block
        for i, j in itertools.product(range(inside), repeat=2):
            assert maxima[i, j] == reachable(field, block, square, i, j)


@pytest.mark.parametrize("coarse", range(2, 13))
def test_no_pose_of_a_square_has_a_larger_prior(coarse):
    window = Window(2, 3, 0.01, coarse, coarse)
    objective = Objective(1.0, 0.37, 900.0)
    first = -2 * coarse
    for step, i, j in itertools.product(range(7), range(4), range(4)):
        row, column = first + i * coarse, first + j * coarse
        inside = [
            multilevel._log_prior(step, row + a, column + b, window, objective)
            for a, b in itertools.product(range(coarse), repeat=2)
        ]
        assert multilevel._largest_prior(step, row, column, coarse, window, objective) == max(inside)


def problem(rng, coarse, quarter, block, half_voxels):
    """A field, a scan of at least part of it, and a pose around which both have room."""
    window = Window(half_voxels, int(rng.integers(0, 4)), float(rng.uniform(0.01, 0.2)), coarse, quarter)
    reach_cells = 25
    middle = reach_cells + (half_voxels + 2) * coarse + 2 * block + 2
    side = block * (2 * middle // block)
    field = random_field(rng, side)
    predicted = np.array((*rng.uniform(middle - 3.0, middle - 2.0, 2), rng.uniform(-4.0, 4.0)))
    beams = int(rng.choice([0, 1, 2, 10, 30]))
    bearings, ranges_m = rng.uniform(-4.0, 4.0, beams), rng.uniform(0.0, 2.0, beams)
    points = np.stack([ranges_m * np.cos(bearings), ranges_m * np.sin(bearings)], axis=1)
    if rng.random() < 0.3 and (field == 255).any():  # end points on surfaces
        rows, columns = np.nonzero(field == 255)
        picked = rng.integers(0, len(rows), beams)
        x = (columns[picked] + 0.5 - predicted[0]) * RESOLUTION_M
        y = (rows[picked] + 0.5 - predicted[1]) * RESOLUTION_M
        c, s = np.cos(-predicted[2]), np.sin(-predicted[2])
        near = np.hypot(x, y) < reach_cells * RESOLUTION_M - 0.5
        points = np.stack([c * x - s * y, s * x + c * y], axis=1)[near]
    objective = Objective(
        float(rng.choice([0.01, 1.0])), float(rng.choice([0.0, 0.05])), float(rng.choice([0.0, 25.0]))
    )
    return field, points, predicted, window, objective


def assert_exact(field, points, predicted, window, objective, block):
    level = coarse_level(field, block, window.coarse, window.quarter)
    found = search(field, level, points, predicted, RESOLUTION_M, window, objective)
    best = best_pose(field, points, predicted, RESOLUTION_M, window, objective)
    assert (found.score, found.step, found.row, found.column) == best
    return found


@pytest.mark.parametrize(
    ("coarse", "quarter", "block"),
    [
        (2, 1, 1),
        (3, 3, 3),
        (3, 3, 1),
        (4, 2, 2),
        (5, 5, 5),
        (6, 3, 3),
        (7, 7, 1),
        (8, 4, 4),
        (9, 9, 3),
        (10, 5, 5),
        (10, 10, 2),
        (11, 11, 1),
        (12, 6, 3),
    ],
)
def test_the_search_finds_what_looking_everywhere_finds(coarse, quarter, block):
    """Of equal poses the same one, too: with no prior and a field of few levels there are many."""
    rng = np.random.default_rng([coarse, quarter, block, 2])
    for _ in range(12):
        half_voxels = int(rng.integers(1, 3 if coarse < 6 else 2))
        assert_exact(*problem(rng, coarse, quarter, block, half_voxels), block)


@pytest.mark.parametrize("cell_precision", [0.0, 0.1])
def test_an_empty_scan_goes_where_it_is_expected(cell_precision):
    """Without a prior all poses are equal, and the first in order is the one."""
    window = Window(1, 2, 0.05, 4, 2)
    field, points = np.zeros((40, 40), np.uint8), np.zeros((0, 2))
    predicted = np.array((20.0, 20.0, 0.3))
    found = assert_exact(field, points, predicted, window, Objective(1.0, cell_precision, cell_precision), 2)
    assert (found.step, found.row, found.column) == ((0, 0, 0) if cell_precision else (-2, -4, -4))


def test_a_window_of_one_angle_is_searched_like_any():
    rng = np.random.default_rng(12)
    for _ in range(20):
        field, points, predicted, window, objective = problem(rng, 4, 2, 2, 1)
        assert_exact(field, points, predicted, window._replace(half_steps=0), objective, 2)


def test_in_a_room_most_of_the_window_is_never_looked_at():
    """A scan of walls 1 m off: the search scores a small part of the window's quarters."""
    side, coarse, quarter, block = 160, 10, 5, 5
    field = room_field(side, 50, 110)
    rows, columns = np.nonzero(field == 255)
    true = np.array((84.3, 77.6))
    points = (np.stack([columns, rows], axis=1) + 0.5 - true)[::2] * RESOLUTION_M
    points = points[np.hypot(*points.T) < 6.0]
    window = Window(2, 10, 0.02, coarse, quarter)
    predicted = np.array((true[0] - 9.0, true[1] + 6.0, 0.08))
    found = assert_exact(field, points, predicted, window, Objective(0.02, 0.001, 1.0), block)
    assert (found.row, found.column, found.step) == (-6, 9, -4)
    # Of 21 x 4 x 4 voxels of four quarters each; not even those of an opened voxel are all scored.
    assert 1 <= found.quarters_scored < 12
