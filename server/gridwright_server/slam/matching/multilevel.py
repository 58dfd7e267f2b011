"""The exact two-level search (thesis 4.2.2): the best pose of a window, and nothing overlooked.

The window is a lattice of poses around the predicted one: whole cells in x and y, equal steps in
theta. Turning the scan once per angle, moving it by whole cells only shifts the cells its end points
fall in, so scoring a row of poses reads the field contiguously.

A voxel is a square of poses of one angle. Where an end point falls in cell (r, c) for the voxel's
first pose, it falls within [r, r + side) x [c, c + side) for all of them. The coarse level (see
`grid.patch.reachable_maximum`) holds, for every block of cells, the maximum of the field over all the
cells that such a square can reach from inside that block. So a voxel's coarse score is never below a
score inside it: moving inside the voxel no end point leaves its square, and the angle is the same.
(Hess 2016, section V, reaches the bound by a sliding maximum per cell, Olson 2009 per block.)

The search opens voxels in the order of their bounds and ends when the next bound is below the best
score. An opened voxel is first cut in quarters, which the same blocks bound more tightly, and only
the quarters that may still hold the best pose are scored pose by pose.

Scores are of the posterior: likelihood_scale * (sum of field values) - 0.5 * squared normalised
distance from the predicted pose.
"""

import math
from typing import NamedTuple

import numpy as np

from gridwright_server.jit import kernel


class Window(NamedTuple):
    """The lattice of poses to search.

    Offsets run over [-half_voxels, half_voxels) * coarse cells in x and y, and over
    [-half_steps, half_steps] steps in theta.
    """

    half_voxels: int
    half_steps: int
    angle_step_rad: float
    coarse: int
    """Poses along the side of a voxel."""
    quarter: int
    """Poses along the side of a quarter; equals coarse where that is odd."""


class Objective(NamedTuple):
    """What is maximised."""

    likelihood_scale: float
    """Log-likelihood per step of the field, tempered."""
    cell_precision: float
    """1 / variance of the predicted position, in 1 / cells^2"""
    angle_precision: float
    """1 / variance of the predicted heading, in 1 / rad^2"""


class LatticeMatch(NamedTuple):
    """The best pose of the window, as offsets from the predicted pose."""

    row: int
    column: int
    step: int
    score: float
    quarters_scored: int
    """How many quarters had to be searched at the fine level."""


@kernel
def end_cells(points, x_cells, y_cells, theta, resolution_m, rows, columns):
    """The cells that a scan's end points fall in; the pose is in cells of the patch, points in m."""
    c, s = math.cos(theta) / resolution_m, math.sin(theta) / resolution_m
    for k in range(len(points)):
        columns[k] = math.floor(x_cells + c * points[k, 0] - s * points[k, 1])
        rows[k] = math.floor(y_cells + s * points[k, 0] + c * points[k, 1])


@kernel
def search(field, level, points, predicted, resolution_m, window, objective):
    """The best pose of the window; of equal ones the first in order of angle, row and column.

    field: shape (rows, columns), uint8, the patch of the likelihood field that the window can reach;
    level: of the same patch; points: shape (returns, 2), in base_link, m; predicted: (column, row, theta),
    the predicted pose in cells of the patch and rad. quarter must be a multiple of block_cells.
    """
    steps, voxels = 2 * window.half_steps + 1, 2 * window.half_voxels
    first = -window.half_voxels * window.coarse
    rows = np.empty((steps, len(points)), np.int32)
    columns = np.empty((steps, len(points)), np.int32)
    bounds = np.empty((steps, voxels, voxels))
    sums = np.empty((voxels, voxels), np.int32)
    for step in range(steps):
        theta = predicted[2] + (step - window.half_steps) * window.angle_step_rad
        end_cells(
            points, predicted[0] + first, predicted[1] + first, theta, resolution_m, rows[step], columns[step]
        )
        _coarse_sums(level.voxel, level.block_cells, rows[step], columns[step], 0, 0, window.coarse, sums)
        for i in range(voxels):
            for j in range(voxels):
                prior = _largest_prior(
                    step,
                    first + i * window.coarse,
                    first + j * window.coarse,
                    window.coarse,
                    window,
                    objective,
                )
                bounds[step, i, j] = objective.likelihood_scale * sums[i, j] + prior
    best = LatticeMatch(0, 0, 0, -np.inf, 0)
    order = bounds.ravel()
    while True:
        voxel = order.argmax()
        if order[voxel] < best.score or order[voxel] == -np.inf:
            return best
        order[voxel] = -np.inf
        step, i, j = voxel // (voxels * voxels), voxel // voxels % voxels, voxel % voxels
        best = _open(
            field,
            level,
            rows[step],
            columns[step],
            step,
            i * window.coarse,
            j * window.coarse,
            window,
            objective,
            best,
        )


@kernel
def _coarse_sums(maxima, block_cells, rows, columns, row0, column0, side, sums):
    """sums[i, j]: coarse score of the square whose first pose is (row0 + i side, column0 + j side) away."""
    sums[:] = 0
    stride = side // block_cells
    # Half a cell off every border between blocks, rounding cannot cross one; and it beats a division.
    per_cell = 1.0 / block_cells
    for k in range(len(rows)):
        row, column = int((rows[k] + row0 + 0.5) * per_cell), int((columns[k] + column0 + 0.5) * per_cell)
        for i in range(sums.shape[0]):
            for j in range(sums.shape[1]):
                sums[i, j] += maxima[row + i * stride, column + j * stride]


@kernel
def _largest_prior(step, row, column, side, window, objective):
    """Log prior of the pose nearest to the predicted one in a square of poses; up to a constant."""
    y = max(row, -(row + side - 1), 0)
    x = max(column, -(column + side - 1), 0)
    return _log_prior(step, y, x, window, objective)


@kernel
def _log_prior(step, row, column, window, objective):
    angle = (step - window.half_steps) * window.angle_step_rad
    squared = objective.cell_precision * (row * row + column * column)
    return -0.5 * (objective.angle_precision * angle * angle + squared)


@kernel
def _open(field, level, rows, columns, step, row, column, window, objective, best):
    """Searches one voxel, quarter by quarter; (row, column) count from the window's first pose."""
    side = window.quarter
    per_voxel = window.coarse // side
    first = -window.half_voxels * window.coarse
    sums = np.empty((per_voxel, per_voxel), np.int32)
    _coarse_sums(level.quarter, level.block_cells, rows, columns, row, column, side, sums)
    scores = np.empty((side, side), np.int32)
    for i in range(per_voxel):
        for j in range(per_voxel):
            row0, column0 = row + i * side, column + j * side
            prior = _largest_prior(step, first + row0, first + column0, side, window, objective)
            if objective.likelihood_scale * sums[i, j] + prior < best.score:
                continue
            score_square(field, rows, columns, row0, column0, scores)
            best = _best_of(scores, first + row0, first + column0, step, window, objective, best)
    return best


@kernel
def score_square(field, rows, columns, row0, column0, scores):
    """scores[i, j] = sum of the field over the end points moved by (row0 + i, column0 + j)."""
    scores[:] = 0
    for k in range(len(rows)):
        row, column = rows[k] + row0, columns[k] + column0
        for i in range(scores.shape[0]):
            for j in range(scores.shape[1]):
                scores[i, j] += field[row + i, column + j]


@kernel
def _best_of(scores, row0, column0, step, window, objective, best):
    quarters = best.quarters_scored + 1
    for i in range(scores.shape[0]):
        for j in range(scores.shape[1]):
            row, column = row0 + i, column0 + j
            score = objective.likelihood_scale * scores[i, j] + _log_prior(
                step, row, column, window, objective
            )
            candidate = LatticeMatch(row, column, step - window.half_steps, score, quarters)
            if score > best.score or (score == best.score and _precedes(candidate, best)):
                best = candidate
    return LatticeMatch(best.row, best.column, best.step, best.score, quarters)


@kernel
def _precedes(a, b):
    """Order among poses of equal score, so that the answer does not depend on the search's order."""
    if a.step != b.step:
        return a.step < b.step
    if a.row != b.row:
        return a.row < b.row
    return a.column < b.column
