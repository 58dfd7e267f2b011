import math

import numpy as np
from gridwright_client import se2
from hypothesis import given
from hypothesis import strategies as st

coordinates = st.floats(-100.0, 100.0)
angles = st.floats(-math.pi, math.pi - 1e-9)
poses = st.builds(lambda x, y, theta: np.array((x, y, theta)), coordinates, coordinates, angles)


def assert_same(first, second, tolerance=1e-9):
    np.testing.assert_allclose(first[..., :2], second[..., :2], atol=tolerance)
    np.testing.assert_allclose(se2.wrap(first[..., 2] - second[..., 2]), 0.0, atol=tolerance)


def test_composition_turns_the_second_pose_by_the_first():
    composed = se2.compose(np.array((1.0, 2.0, math.pi / 2)), np.array((3.0, 1.0, math.pi / 4)))
    assert_same(composed, np.array((0.0, 5.0, 3 * math.pi / 4)))


@given(poses)
def test_a_pose_and_its_inverse_cancel(pose):
    assert_same(se2.compose(pose, se2.inverse(pose)), np.zeros(3))
    assert_same(se2.compose(se2.inverse(pose), pose), np.zeros(3))


@given(poses, poses)
def test_between_leads_from_one_pose_to_the_other(first, second):
    assert_same(se2.compose(first, se2.between(first, second)), second)


@given(poses, poses, poses)
def test_composition_is_associative(a, b, c):
    assert_same(se2.compose(se2.compose(a, b), c), se2.compose(a, se2.compose(b, c)), 1e-8)


@given(st.floats(-1e4, 1e4))
def test_wrapped_angles_lie_in_half_open_turn(angle):
    wrapped = float(se2.wrap(angle))
    assert -math.pi <= wrapped < math.pi
    assert math.isclose(math.cos(wrapped - angle), 1.0, abs_tol=1e-9)


@given(poses)
def test_exponential_undoes_logarithm(pose):
    assert_same(se2.exponential(se2.logarithm(pose)), pose, 1e-7)


@given(poses, poses)
def test_interpolation_reaches_both_ends(first, second):
    assert_same(se2.interpolate(first, second, 0.0), first, 1e-7)
    assert_same(se2.interpolate(first, second, 1.0), second, 1e-7)


def test_interpolation_follows_the_arc_and_not_its_chord():
    quarter = se2.interpolate(np.zeros(3), np.array((1.0, 1.0, math.pi / 2)), 0.5)
    assert_same(quarter, np.array((math.sin(math.pi / 4), 1.0 - math.cos(math.pi / 4), math.pi / 4)))


@given(poses, poses, st.floats(0.0, 1.0))
def test_the_twist_is_constant_along_the_arc(first, second, fraction):
    middle = se2.interpolate(first, second, fraction)
    whole = se2.logarithm(se2.between(first, second))
    np.testing.assert_allclose(se2.logarithm(se2.between(first, middle)), fraction * whole, atol=1e-6)


def test_everything_broadcasts():
    many = np.arange(24, dtype=np.float64).reshape(2, 4, 3) / 10
    one = np.array((1.0, 2.0, 0.3))
    for index in np.ndindex(2, 4):
        assert_same(se2.compose(one, many)[index], se2.compose(one, many[index]))
        assert_same(se2.interpolate(one, many, 0.3)[index], se2.interpolate(one, many[index], 0.3))
