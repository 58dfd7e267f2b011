"""Scan matching by scoring every pose of the window."""

import numpy as np


def cells_of(points, predicted, column, row, theta, resolution_m):
    """Row and column of the cell that each end point falls in."""
    x = points[:, 0] / resolution_m * np.cos(theta) - points[:, 1] / resolution_m * np.sin(theta)
    y = points[:, 0] / resolution_m * np.sin(theta) + points[:, 1] / resolution_m * np.cos(theta)
    return (
        np.floor(predicted[1] + row + y).astype(int),
        np.floor(predicted[0] + column + x).astype(int),
    )


def best_pose(field, points, predicted, resolution_m, window, objective):
    """(score, step, row, column) of the best pose; of equal ones the first by step, row and column."""
    half = window.half_voxels * window.coarse
    best = None
    for step in range(-window.half_steps, window.half_steps + 1):
        turn = step * window.angle_step_rad
        for row in range(-half, half):
            for column in range(-half, half):
                r, c = cells_of(points, predicted, column, row, predicted[2] + turn, resolution_m)
                fit = int(field[r, c].astype(int).sum())
                moved = objective.cell_precision * (row * row + column * column)
                score = objective.likelihood_scale * fit - 0.5 * (
                    objective.angle_precision * turn * turn + moved
                )
                if best is None or score > best[0]:
                    best = (score, step, row, column)
    return best


def reachable(field, block_cells, side, block_row, block_column):
    """Largest value that a square of `side` cells can cover which starts in a block; in whole blocks."""
    last_row = block_row * block_cells + block_cells - 1 + side - 1
    last_column = block_column * block_cells + block_cells - 1 + side - 1
    end_row = (last_row // block_cells + 1) * block_cells
    end_column = (last_column // block_cells + 1) * block_cells
    return field[block_row * block_cells : end_row, block_column * block_cells : end_column].max()
