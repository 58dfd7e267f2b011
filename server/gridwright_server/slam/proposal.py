"""The improved proposal: a Gaussian fitted to the posterior around the match (4.13, 4.21-4.24)."""

import math
from typing import NamedTuple

import numpy as np

from gridwright_server.jit import kernel
from gridwright_server.slam.matching.refine import log_posterior


class Lattice(NamedTuple):
    """The poses around the match that are weighed."""

    extent: np.ndarray
    """shape (3,): half the lattice's extent along column, row, theta; in cells, cells and rad"""
    samples: int
    """Poses along each axis."""


class Proposal(NamedTuple):
    """N(mean, factor factor^T) and the log of its normaliser eta."""

    mean: np.ndarray
    """shape (3,): (column, row, theta) in cells of the patch and rad"""
    factor: np.ndarray
    """shape (3, 3), lower Cholesky factor of the covariance"""
    log_eta: float
    """Comparable with the log-likelihood of one pose: the prior's density is normalised (4.13)."""


@kernel
def fit(field, points, match, predicted, resolution_m, objective, lattice):
    """Weighs a lattice of samples^3 poses around the match and takes its moments.

    match: (column, row, theta) in cells of the patch and rad. The K = samples^3 poses are a lattice,
    not random: they fit the moments better than as many random ones, and need no draws.
    """
    extent, samples = lattice
    offsets = np.empty((samples, 3))
    for axis in range(3):
        for k in range(samples):
            offsets[k, axis] = extent[axis] * (2.0 * k / (samples - 1) - 1.0)
    logs = np.empty((samples, samples, samples))
    pose = np.empty(3)
    for a in range(samples):
        for b in range(samples):
            for c in range(samples):
                pose[0] = match[0] + offsets[c, 0]
                pose[1] = match[1] + offsets[b, 1]
                pose[2] = match[2] + offsets[a, 2]
                logs[a, b, c] = log_posterior(field, points, pose, predicted, resolution_m, objective)
    highest = logs.max()
    s = 0.0
    u = np.zeros(3)
    K = np.zeros((3, 3))
    offset = np.empty(3)
    for a in range(samples):
        for b in range(samples):
            for c in range(samples):
                p = math.exp(logs[a, b, c] - highest)
                offset[0], offset[1], offset[2] = offsets[c, 0], offsets[b, 1], offsets[a, 2]
                s += p
                for i in range(3):
                    u[i] += p * offset[i]
                    for j in range(3):
                        K[i, j] += p * offset[i] * offset[j]
    mean = u / s
    covariance = K / s
    for i in range(3):
        for j in range(3):
            covariance[i, j] -= mean[i] * mean[j]
    log_eta = highest + math.log(s) + _log_cell_probability(objective, lattice)
    return Proposal(match + mean, _cholesky(covariance, 1e-12), log_eta)


@kernel
def _log_cell_probability(objective, lattice):
    """Log of a lattice cell's volume times the peak of p(x | x', u), which log_posterior leaves out."""
    log_volume = 0.0
    for axis in range(3):
        log_volume += math.log(2.0 * lattice.extent[axis] / (lattice.samples - 1))
    log_peak = math.log(objective.cell_precision) + 0.5 * math.log(objective.angle_precision)
    return log_volume + log_peak - 1.5 * math.log(2.0 * math.pi)


@kernel
def draw(mean, factor, normals):
    """mean + factor * normals: a pose of N(mean, factor factor^T) from three standard normal draws."""
    drawn = mean.copy()
    for i in range(3):
        for j in range(3):
            drawn[i] += factor[i, j] * normals[j]
    return drawn


@kernel
def covariance_of(factor):
    """factor * factor^T, shape (3, 3)."""
    covariance = np.zeros((3, 3))
    for i in range(3):
        for j in range(3):
            for k in range(3):
                covariance[i, j] += factor[i, k] * factor[j, k]
    return covariance


@kernel
def _cholesky(covariance, floor):
    """Lower factor of a 3 x 3 covariance; pivots below `floor` (rounding) count as none."""
    factor = np.zeros((3, 3))
    for i in range(3):
        for j in range(i + 1):
            rest = covariance[i, j]
            for k in range(j):
                rest -= factor[i, k] * factor[j, k]
            if i == j:
                factor[i, i] = math.sqrt(rest) if rest > floor else 0.0
            elif factor[j, j] > 0.0:
                factor[i, j] = rest / factor[j, j]
    return factor
