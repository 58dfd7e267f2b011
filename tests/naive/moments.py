"""Weighted moments of the posterior over a lattice of poses."""

import itertools

import numpy as np
from naive.interpolation import log_posterior


def fitted(field, points, match, predicted, resolution_m, objective, extent, samples):
    """Mean, covariance and log eta: the integral of p(z | x) p(x | x', u) over the lattice's cells."""
    axes = [np.linspace(-extent[axis], extent[axis], samples) for axis in range(3)]
    poses = [match + offset for offset in itertools.product(*axes)]
    logs = np.array(
        [log_posterior(field, points, pose, predicted, resolution_m, objective) for pose in poses]
    )
    weights = np.exp(logs - logs.max())
    mean = np.average(poses, axis=0, weights=weights)
    covariance = np.cov(np.array(poses).T, aweights=weights, ddof=0)
    sigmas = np.array([objective.cell_precision, objective.cell_precision, objective.angle_precision]) ** -0.5
    density = 1.0 / ((2.0 * np.pi) ** 1.5 * sigmas.prod())
    cell = np.prod([axis[1] - axis[0] for axis in axes])
    return mean, covariance, logs.max() + np.log(weights.sum() * density * cell)
