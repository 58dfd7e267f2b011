"""What all kernels share: the maps' geometry and model, the scan, and each particle's part of its map."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gridwright_server.jit import kernel
from gridwright_server.slam.grid.tiles import TileArrays


class Grid(NamedTuple):
    """Geometry of the maps and the model of their update; the same for all particles."""

    resolution_m: float
    tile_cells: int
    block_cells: int
    free: int
    """What a cell loses when a beam crosses it, in LOG_ODDS_UNIT; and what it gains when hit."""
    hit: int
    limit: int
    """Log-odds stay within +- this."""
    stamp: NDArray[np.uint8]
    """The likelihood field around a lone surface."""


class View(NamedTuple):
    """The scan as all particles see it, in base_link."""

    points: NDArray[np.float64]
    """shape (returns, 2): what the beams hit"""
    outline: NDArray[np.float64]
    """shape (corners, 2): the polygon seen free"""


class Maps(NamedTuple):
    """Each particle's map around its pose."""

    arrays: TileArrays
    tables: NDArray[np.int32]
    """shape (particles, size, size): page tables"""
    first_cells: NDArray[np.int64]
    """shape (particles, 2): lattice row and column of the first cell of each page table"""


@kernel
def corner_m_of(maps, p, resolution_m):
    """x and y of the first corner of a particle's part of the map."""
    return np.array((maps.first_cells[p, 1] * resolution_m, maps.first_cells[p, 0] * resolution_m))
