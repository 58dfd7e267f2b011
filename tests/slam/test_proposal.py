"""The Gaussian that the improved proposal draws from."""

import numpy as np
import pytest
from gridwright_server.slam import proposal
from gridwright_server.slam.matching.multilevel import Objective
from gridwright_server.slam.proposal import Lattice, covariance_of, draw, fit
from hypothesis import given, settings
from hypothesis import strategies as st
from naive import moments

RESOLUTION_M = 0.05


@pytest.mark.parametrize("samples", [3, 4, 5])
@pytest.mark.parametrize("seed", range(4))
def test_moments_and_normaliser_are_those_of_the_lattice(samples, seed):
    rng = np.random.default_rng([samples, seed])
    field = rng.integers(0, 256, (60, 60)).astype(np.uint8)
    points = rng.uniform(-0.9, 0.9, (12, 2))
    match = np.array((30.0, 30.0, 0.0)) + rng.uniform(-1.0, 1.0, 3)
    predicted = match + rng.normal(scale=(1.0, 1.0, 0.02))
    objective = Objective(0.01, 0.1, 300.0)
    extent = np.array((1.5, 1.2, 0.03))
    fitted = fit(field, points, match, predicted, RESOLUTION_M, objective, Lattice(extent, samples))
    mean, covariance, log_eta = moments.fitted(
        field, points, match, predicted, RESOLUTION_M, objective, extent, samples
    )
    np.testing.assert_allclose(fitted.mean, mean, atol=1e-9)
    np.testing.assert_allclose(covariance_of(fitted.factor), covariance, rtol=1e-6, atol=1e-11)
    assert fitted.log_eta == pytest.approx(log_eta)


def test_a_posterior_that_is_the_prior_is_fitted_as_such():
    """No end points: what is fitted is the motion model, where the lattice is wide and fine enough."""
    field, nothing, match = np.zeros((9, 9), np.uint8), np.zeros((0, 2)), np.zeros(3)
    lattice = Lattice(np.array((4.0, 4.0, 0.4)), 15)
    fitted = fit(field, nothing, match, match, RESOLUTION_M, Objective(1.0, 1.0, 100.0), lattice)
    np.testing.assert_allclose(fitted.mean, 0.0, atol=1e-12)
    np.testing.assert_allclose(covariance_of(fitted.factor), np.diag([1.0, 1.0, 0.01]), rtol=0.01, atol=1e-9)


def test_weights_far_below_what_a_float_holds_still_have_moments():
    field, nothing, match = np.zeros((9, 9), np.uint8), np.zeros((0, 2)), np.zeros(3)
    far = np.array((300.0, 0.0, 0.0))
    lattice = Lattice(np.array((1.0, 1.0, 0.1)), 5)
    fitted = fit(field, nothing, match, far, RESOLUTION_M, Objective(1.0, 1.0, 1.0), lattice)
    assert fitted.log_eta == pytest.approx(-0.5 * 299.0**2, abs=5.0)
    assert np.isfinite(fitted.factor).all()
    np.testing.assert_allclose(fitted.mean, (1.0, 0.0, 0.0), atol=1e-6)


@settings(deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(1, 3))
def test_the_factor_is_the_covariances_of_any_rank(seed, rank):
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(3, rank))
    covariance = root @ root.T
    factor = proposal._cholesky(covariance, 1e-12)
    assert (np.triu(factor, 1) == 0.0).all()
    np.testing.assert_allclose(covariance_of(factor), factor @ factor.T, atol=1e-12)
    if rank == 3:
        np.testing.assert_allclose(factor @ factor.T, covariance, atol=1e-6)
    assert np.isfinite(factor).all()


@settings(deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_a_draw_is_an_affine_map_of_the_normals(seed):
    rng = np.random.default_rng(seed)
    mean, factor, normals = rng.normal(size=3), np.tril(rng.normal(size=(3, 3))), rng.normal(size=3)
    before = mean.copy()
    np.testing.assert_allclose(draw(mean, factor, normals), mean + factor @ normals)
    assert np.array_equal(mean, before)
    assert np.array_equal(draw(mean, factor, np.zeros(3)), mean)


def test_many_draws_have_the_moments_they_were_drawn_with():
    rng = np.random.default_rng(3)
    mean, factor = np.array((1.0, -2.0, 0.5)), np.tril(rng.normal(size=(3, 3)))
    drawn = np.array([draw(mean, factor, normals) for normals in rng.standard_normal((20_000, 3))])
    np.testing.assert_allclose(drawn.mean(axis=0), mean, atol=0.05)
    np.testing.assert_allclose(np.cov(drawn.T), factor @ factor.T, atol=0.1)
