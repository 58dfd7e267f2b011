"""SE(2) against homogeneous matrices."""

import math

import numpy as np
import pytest
from gridwright_server.slam import se2
from hypothesis import given, settings
from hypothesis import strategies as st
from naive.homogeneous import driven, matrix

distance = st.floats(-1e3, 1e3)
poses = st.tuples(distance, distance, st.floats(-10.0, 10.0)).map(np.array)


def assert_same_pose(actual, expected, tolerance=1e-9):
    np.testing.assert_allclose(matrix(actual), matrix(expected), rtol=0.0, atol=tolerance)


@settings(deadline=None)
@given(st.floats(-1e4, 1e4))
def test_a_wrapped_angle_is_the_same_direction_within_half_a_turn(angle):
    wrapped = se2.wrap(angle)
    assert -math.pi <= wrapped <= math.pi
    assert (wrapped - angle) / (2.0 * math.pi) == pytest.approx(
        round((wrapped - angle) / (2.0 * math.pi)), abs=1e-9
    )


def test_half_a_turn_wraps_to_minus_pi():
    assert se2.wrap(math.pi) == -math.pi
    assert se2.wrap(-math.pi) == -math.pi


@settings(deadline=None)
@given(poses, poses)
def test_compose_is_the_matrix_product(a, b):
    np.testing.assert_allclose(matrix(se2.compose(a, b)), matrix(a) @ matrix(b), rtol=0.0, atol=1e-9)


@settings(deadline=None)
@given(st.lists(poses, max_size=5), poses)
def test_compose_all_composes_each(many, b):
    many = np.array(many).reshape(-1, 3)
    expected = np.array([se2.compose(a, b) for a in many]).reshape(-1, 3)
    np.testing.assert_array_equal(se2.compose_all(many, b), expected)


@settings(deadline=None)
@given(poses, poses)
def test_between_undoes_compose(a, b):
    np.testing.assert_allclose(
        matrix(se2.between(a, b)), np.linalg.inv(matrix(a)) @ matrix(b), rtol=0.0, atol=1e-8
    )


@settings(deadline=None)
@given(poses)
def test_inverse_is_the_inverse_matrix(a):
    np.testing.assert_allclose(matrix(se2.inverse(a)), np.linalg.inv(matrix(a)), rtol=0.0, atol=1e-8)


@settings(deadline=None)
@given(poses)
def test_none_of_the_way_is_nowhere_and_all_of_it_is_there(a):
    assert_same_pose(se2.along(a, 0.0), np.zeros(3))
    assert_same_pose(se2.along(a, 1.0), a, 1e-8)


@settings(deadline=None)
@given(
    st.tuples(st.floats(-10, 10), st.floats(-10, 10), st.floats(-3.1, 3.1)).map(np.array),
    st.floats(0.0, 2.0),
    st.floats(0.0, 2.0),
)
def test_fractions_of_the_way_add_up(a, first, second):
    both = se2.compose(se2.along(a, first), se2.along(a, second))
    assert_same_pose(se2.along(a, first + second), both, 1e-8)


@settings(deadline=None)
@given(
    st.floats(-2.0, 2.0),
    st.floats(-2.0, 2.0),
    st.one_of(st.floats(-3.0, 3.0), st.floats(-1e-3, 1e-3), st.just(0.0)),
    st.floats(0.0, 1.5),
)
def test_the_way_is_driven_at_a_constant_twist(vx, vy, omega, fraction):
    whole = driven((vx, vy, omega), 1.0)
    assert_same_pose(se2.along(whole, fraction), driven((vx, vy, omega), fraction), 0.01)


def test_a_circle_stays_a_circle():
    radius, angle = 2.0, 1.8
    end = np.array([radius * math.sin(angle), radius * (1.0 - math.cos(angle)), angle])
    for fraction in np.linspace(0.0, 1.5, 16):
        turn = fraction * angle
        on_circle = [radius * math.sin(turn), radius * (1.0 - math.cos(turn)), turn]
        assert_same_pose(se2.along(end, fraction), on_circle)
