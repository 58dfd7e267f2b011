"""Weights, effective sample size and the low-variance sampler."""

import numpy as np
import pytest
from gridwright_server.slam.resampling import effective_sample_size, low_variance_ancestors, normalised
from hypothesis import given, settings
from hypothesis import strategies as st

log_weights = st.lists(st.floats(-2000.0, 2000.0), min_size=1, max_size=50).map(np.array)
offsets = st.floats(0.0, 1.0, exclude_max=True)


@settings(deadline=None)
@given(log_weights)
def test_weights_sum_to_one_however_small_their_logs(logs):
    weights = normalised(logs)
    assert weights.sum() == pytest.approx(1.0)
    assert (weights >= 0.0).all()
    assert 1.0 - 1e-9 <= effective_sample_size(weights) <= len(weights) + 1e-9


def test_logs_of_minus_a_thousand_keep_their_ratio():
    np.testing.assert_allclose(normalised(np.log([1.0, 3.0]) - 1000.0), [0.25, 0.75])
    np.testing.assert_allclose(normalised(np.array([-1000.0, 0.0])), [0.0, 1.0], atol=1e-300)


def test_effective_sample_size_counts_who_matters():
    assert effective_sample_size(np.full(20, 0.05)) == pytest.approx(20.0)
    assert effective_sample_size(np.array([0.0, 1.0, 0.0])) == 1.0
    assert effective_sample_size(np.array([0.5, 0.5, 0.0, 0.0])) == pytest.approx(2.0)


@settings(deadline=None)
@given(log_weights.map(normalised), offsets)
def test_everyone_gets_its_share_of_copies_rounded_up_or_down(weights, offset):
    ancestors = low_variance_ancestors(weights, offset)
    assert len(ancestors) == len(weights)
    assert (np.diff(ancestors) >= 0).all()
    shares = len(weights) * weights
    copies = np.bincount(ancestors, minlength=len(weights))
    assert (copies >= np.floor(shares - 1e-9)).all()
    assert (copies <= np.ceil(shares + 1e-9)).all()


@pytest.mark.parametrize("offset", [0.0, 0.3, 0.999])
def test_equal_weights_keep_everyone(offset):
    assert low_variance_ancestors(np.full(7, 1.0 / 7.0), offset).tolist() == list(range(7))


def test_over_all_offsets_copies_are_in_proportion():
    weights = normalised(np.random.default_rng(1).normal(size=8))
    counts = np.zeros(8)
    for offset in (np.arange(2000) + 0.5) / 2000:
        counts += np.bincount(low_variance_ancestors(weights, offset), minlength=8)
    np.testing.assert_allclose(counts / 2000, 8 * weights, atol=0.01)
