"""Weights, effective sample size and the low-variance sampler."""

import math

import numpy as np
from numpy.typing import NDArray


def normalised(log_weights: NDArray[np.float64]) -> NDArray[np.float64]:
    """Weights that sum to 1, computed in the log domain; shape (particles,)."""
    weights: NDArray[np.float64] = np.exp(log_weights - log_weights.max())
    weights /= weights.sum()
    return weights


def effective_sample_size(weights: NDArray[np.float64]) -> float:
    """N_eff = 1 / sum of squared normalised weights: between 1 and the number of particles."""
    return float(1.0 / np.square(weights).sum())


def low_variance_ancestors(weights: NDArray[np.float64], offset: float) -> NDArray[np.int64]:
    """Whose copy each particle becomes; shape (particles,), ascending.

    One comb of equally spaced teeth, shifted by `offset` in [0, 1) of a tooth, is laid over the
    cumulated weights (Thrun, Burgard, Fox 2005, table 4.4): a particle of weight w gets floor(N w)
    or ceil(N w) copies.
    """
    count = len(weights)
    teeth = (np.arange(count) + offset) / count
    cumulated = np.cumsum(weights)
    cumulated[-1] = math.inf  # rounding must not leave a tooth without a particle
    return np.searchsorted(cumulated, teeth, side="right").astype(np.int64)
