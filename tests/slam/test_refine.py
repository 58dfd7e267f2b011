"""Poses between the lattice's."""

import numpy as np
import pytest
from gridwright_server.slam.matching.multilevel import Objective, Window
from gridwright_server.slam.matching.refine import (
    CLIMB_LIMIT,
    HALVINGS,
    climb,
    interpolated_sum,
    log_posterior,
)
from naive import interpolation
from naive.one_map import field_of

RESOLUTION_M = 0.05
SIDE = 80
MIDDLE = np.array((40.0, 40.0, 0.0))
WINDOW = Window(2, 10, 0.01, 10, 5)


def scan(rng, beams):
    bearings, ranges_m = rng.uniform(-3.1, 3.1, beams), rng.uniform(0.0, 1.3, beams)
    return np.stack([ranges_m * np.cos(bearings), ranges_m * np.sin(bearings)], axis=1)


def corner_field():
    """Two walls that meet, so that a scan of them fits in one place only."""
    cells = np.arange(SIDE)
    walls = [(20, k) for k in range(20, 60)] + [(k, 20) for k in range(20, 60)]
    return field_of(walls, cells, cells, RESOLUTION_M, 0.1, 0.05).astype(np.uint8)


def corner_scan(true):
    """End points on both walls, as seen from `true`, a pose in cells."""
    ends = [(20.5, k + 0.5) for k in range(22, 60, 2)] + [(k + 0.5, 20.5) for k in range(22, 60, 2)]
    c, s = np.cos(-true[2]), np.sin(-true[2])
    x, y = (np.array(ends) - true[:2]).T * RESOLUTION_M
    return np.stack([c * x - s * y, s * x + c * y], axis=1)


@pytest.mark.parametrize("seed", range(20))
def test_the_sum_is_bilinear_between_centres(seed):
    rng = np.random.default_rng(seed)
    field = rng.integers(0, 256, (SIDE, SIDE)).astype(np.uint8)
    points = scan(rng, int(rng.integers(0, 40)))
    pose = MIDDLE + rng.uniform(-3.0, 3.0, 3)
    expected = interpolation.total(field, points, pose, RESOLUTION_M)
    assert interpolated_sum(field, points, *pose, RESOLUTION_M) == pytest.approx(expected, abs=1e-6)
    predicted, objective = pose + rng.normal(size=3), Objective(0.02, 0.3, 50.0)
    expected = interpolation.log_posterior(field, points, pose, predicted, RESOLUTION_M, objective)
    actual = log_posterior(field, points, pose, predicted, RESOLUTION_M, objective)
    assert actual == pytest.approx(expected, abs=1e-6)


def test_at_a_centre_it_is_the_cells_own_value():
    field = np.random.default_rng(1).integers(0, 256, (SIDE, SIDE)).astype(np.uint8)
    assert interpolated_sum(field, np.zeros((1, 2)), 12.5, 30.5, 0.3, RESOLUTION_M) == field[30, 12]


@pytest.mark.parametrize("seed", range(20))
def test_climbing_ends_on_a_top_no_lower_than_its_start(seed):
    rng = np.random.default_rng(seed)
    field = corner_field() if seed % 2 else rng.integers(0, 256, (SIDE, SIDE)).astype(np.uint8)
    points = corner_scan(MIDDLE) if seed % 2 else scan(rng, int(rng.integers(0, 30)))
    start = MIDDLE + rng.normal(scale=(1.0, 1.0, 0.02))
    predicted = start + rng.normal(scale=(2.0, 2.0, 0.02))
    objective = Objective(0.02, 0.05, 200.0)

    def value(pose):
        return log_posterior(field, points, pose, predicted, RESOLUTION_M, objective)

    before = start.copy()
    top = climb(field, points, start, predicted, RESOLUTION_M, WINDOW, objective)
    assert np.array_equal(start, before)
    assert value(top) >= value(start)
    unit = np.array((1.0, 1.0, WINDOW.angle_step_rad))
    last = 0.5**HALVINGS * unit
    for axis in range(3):
        for sign in (-1.0, 1.0):
            beside = top.copy()
            beside[axis] += sign * last[axis]
            within = (np.abs(beside - start) <= CLIMB_LIMIT * unit).all()
            assert value(beside) <= value(top) or not within
    assert (np.abs(top - start) <= CLIMB_LIMIT * unit).all()


@pytest.mark.parametrize("seed", range(5))
def test_climbing_finds_the_true_pose_below_a_cell(seed):
    rng = np.random.default_rng(seed)
    true = MIDDLE + rng.uniform(-1.0, 1.0, 3) * (1.0, 1.0, 0.05)
    start = true + rng.uniform(-1.0, 1.0, 3) * (0.5, 0.5, 0.005)
    top = climb(
        corner_field(), corner_scan(true), start, start, RESOLUTION_M, WINDOW, Objective(0.1, 1e-6, 1e-6)
    )
    np.testing.assert_allclose(top[:2], true[:2], atol=0.1)
    assert top[2] == pytest.approx(true[2], abs=0.003)


def test_without_end_points_it_climbs_to_where_it_is_expected():
    predicted = MIDDLE + 0.25
    field, nothing = np.zeros((SIDE, SIDE), np.uint8), np.zeros((0, 2))
    top = climb(field, nothing, MIDDLE, predicted, RESOLUTION_M, WINDOW, Objective(1.0, 1.0, 1e-9))
    np.testing.assert_allclose(top[:2], predicted[:2], atol=1 / 32)
