"""The likelihood field: how well an end point in a cell fits the nearest surface (4.20).

A cell is a surface when it is more likely occupied than free. For an end point at distance d from the
nearest surface, p(z_j | x, m) is a mixture of a Gaussian around the surface and a uniform outlier:

    log p = log((1 - outlier) * exp(-d^2 / (2 sigma^2)) + outlier)

The field holds it in 255 steps, 255 on a surface, 0 from the truncation distance on, and unknown
space counts as far from any surface.

Invariant: a cell's field is the table's value at the distance to the nearest surface of its map.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridwright_server.config import SensorConfig
from gridwright_server.jit import kernel
from gridwright_server.slam.grid.tiles import NO_TILE

STEPS = 255
NEGLIGIBLE = 0.01
"""The field is cut off where it has fallen to this fraction of its range."""


@dataclass(frozen=True)
class LikelihoodModel:
    """The observation model, tabulated for the grid's resolution."""

    stamp: NDArray[np.uint8]
    """shape (2 r + 1, 2 r + 1): the field around a lone surface in the middle"""
    log_likelihood_per_step: float
    """A beam's log-likelihood is its field value times this, up to a constant."""

    @property
    def radius(self) -> int:
        """Cells from a surface to the truncation distance."""
        return len(self.stamp) // 2


def likelihood_model(config: SensorConfig, resolution_m: float) -> LikelihoodModel:
    """Tabulates the mixture over the cells around a surface."""
    sigma, outlier = config.hit_sigma_meters, config.outlier_probability
    log_range = -math.log(outlier)  # from on the surface (p = 1) to far away (p = outlier)

    def fraction(distance_m: NDArray[np.float64]) -> NDArray[np.float64]:
        gaussian = np.exp(-0.5 * np.square(distance_m / sigma))
        return 1.0 + np.log((1.0 - outlier) * gaussian + outlier) / log_range

    radius = 1
    while fraction(np.array(radius * resolution_m)) > NEGLIGIBLE:
        radius += 1
    offsets = np.arange(-radius, radius + 1) * resolution_m
    stamp = fraction(np.hypot(offsets[:, None], offsets[None, :]))
    stamp[stamp < NEGLIGIBLE] = 0.0
    return LikelihoodModel(np.rint(STEPS * stamp).astype(np.uint8), log_range / STEPS)


@kernel
def add_surface(field, table, tile_cells, row, column, stamp):
    """Raises the field around a new surface; row and column count from the table's first cell."""
    side, radius = stamp.shape[0], stamp.shape[0] // 2
    tile_columns, columns = _tiles_along(column - radius, side, tile_cells)
    for i in range(side):
        tile_row, r = divmod(row + i - radius, tile_cells)
        for j in range(side):
            tile, c = table[tile_row, tile_columns[j]], columns[j]
            if stamp[i, j] > field[tile, r, c]:
                field[tile, r, c] = stamp[i, j]


@kernel
def remove_surface(log_odds, field, table, tile_cells, row, column, stamp):
    """Recomputes the field where a surface that is gone could have been the nearest.

    That is the square of the stamp's size around it; surfaces up to a radius further out reach into it.
    """
    side, radius = stamp.shape[0], stamp.shape[0] // 2
    local = np.zeros((side, side), np.uint8)
    reach = 2 * side - 1
    tile_columns, columns = _tiles_along(column - 2 * radius, reach, tile_cells)
    for i in range(reach):
        tile_row, r = divmod(row + i - 2 * radius, tile_cells)
        if tile_row < 0 or tile_row >= table.shape[0]:
            continue
        for j in range(reach):
            if tile_columns[j] < 0 or tile_columns[j] >= table.shape[1]:
                continue
            tile = table[tile_row, tile_columns[j]]
            if tile != NO_TILE and log_odds[tile, r, columns[j]] > 0:
                _stamp_at(local, stamp, i - 2 * radius, j - 2 * radius)
    for i in range(side):
        tile_row, r = divmod(row + i - radius, tile_cells)
        for j in range(side):
            k = j + radius
            field[table[tile_row, tile_columns[k]], r, columns[k]] = local[i, j]


@kernel
def _tiles_along(first, count, tile_cells):
    """Tile and place in it of `count` successive cells: a division for each cell would be slow."""
    tiles, places = np.empty(count, np.int64), np.empty(count, np.int64)
    tile, place = divmod(first, tile_cells)
    for k in range(count):
        tiles[k], places[k] = tile, place
        place += 1
        if place == tile_cells:
            tile, place = tile + 1, 0
    return tiles, places


@kernel
def _stamp_at(local, stamp, row, column):
    """Raises `local`, shaped as the stamp, by a stamp whose middle is (row, column) off its own."""
    side = stamp.shape[0]
    for i in range(max(row, 0), min(side + row, side)):
        for j in range(max(column, 0), min(side + column, side)):
            local[i, j] = max(local[i, j], stamp[i - row, j - column])
