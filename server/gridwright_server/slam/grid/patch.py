"""The part of a particle's map that a search can reach, laid out densely.

Lookups through a page table cost more than the copy of the tiles they would touch. A patch is a whole
number of tiles; only the tiles that end points can fall in are filled, the rest is left as it was.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gridwright_server.jit import kernel
from gridwright_server.slam.grid.tiles import NO_TILE


class CoarseLevel(NamedTuple):
    """The field's maxima over what a voxel's and a quarter's end points can reach; per block."""

    block_cells: int
    voxel: NDArray[np.uint8]
    quarter: NDArray[np.uint8]


class Patch(NamedTuple):
    """The part of a particle's map around its pose, laid out densely; storage used again and again."""

    field: NDArray[np.uint8]
    blocks: NDArray[np.uint8]
    scratch: NDArray[np.uint8]
    reached: NDArray[np.bool_]
    level: CoarseLevel


@kernel
def new_patch(size, grid):
    """Storage for the part of a map that `size` x `size` tiles cover."""
    blocks_along = size * grid.tile_cells // grid.block_cells
    blocks = np.empty((blocks_along, blocks_along), np.uint8)
    return Patch(
        np.empty((size * grid.tile_cells, size * grid.tile_cells), np.uint8),
        blocks,
        np.empty_like(blocks),
        np.empty((size, size), np.bool_),
        CoarseLevel(grid.block_cells, np.empty_like(blocks), np.empty_like(blocks)),
    )


@kernel
def tiles_reached(points, pose, slack_cells, slack_rad, grid, reached):
    """Marks the tiles that end points can fall in, wherever within the slack the pose is.

    points: shape (returns, 2), in base_link, m; pose: (column, row, theta), in cells of the patch;
    reached: shape (tile rows, tile columns).
    """
    reached[:] = False
    c, s = math.cos(pose[2]) / grid.resolution_m, math.sin(pose[2]) / grid.resolution_m
    per_tile = 1.0 / grid.tile_cells
    for k in range(len(points)):
        px, py = points[k, 0], points[k, 1]
        column, row = pose[0] + c * px - s * py, pose[1] + s * px + c * py
        slack = slack_cells + slack_rad * math.hypot(px, py) / grid.resolution_m
        bottom = max(math.floor((row - slack) * per_tile), 0)
        top = min(math.floor((row + slack) * per_tile) + 1, reached.shape[0])
        left = max(math.floor((column - slack) * per_tile), 0)
        right = min(math.floor((column + slack) * per_tile) + 1, reached.shape[1])
        for i in range(bottom, top):
            for j in range(left, right):
                reached[i, j] = True


@kernel
def gather(tiles, table, reached, out):
    """Copies the reached tiles of a page table side by side; zero where there is none.

    tiles: shape (capacity, n, n); out: shape (table rows * n, table columns * n).
    """
    n = tiles.shape[1]
    for tile_row in range(table.shape[0]):
        for tile_column in range(table.shape[1]):
            if not reached[tile_row, tile_column]:
                continue
            tile = table[tile_row, tile_column]
            row0, column0 = tile_row * n, tile_column * n
            if tile == NO_TILE:
                for i in range(n):
                    for j in range(n):
                        out[row0 + i, column0 + j] = 0
            else:
                for i in range(n):
                    for j in range(n):
                        out[row0 + i, column0 + j] = tiles[tile, i, j]


@kernel
def reachable_maximum(blocks, block_cells, side, along, out):
    """The coarse level: out[i, j] = maximum over all cells that a square reaches from block (i, j).

    blocks: shape (rows, columns), uint8, the maximum of the field over each block of cells. A square
    of `side` cells that starts within a block ends at most (block_cells - 1) + (side - 1) further.
    along: scratch, shaped as blocks. What lies within reach of the last rows and columns is not
    worked out: a patch is larger than what its end points fall in.
    """
    reach = (block_cells + side - 2) // block_cells + 1
    rows, columns = blocks.shape
    for i in range(rows):
        for j in range(columns - reach + 1):
            along[i, j] = blocks[i, j]
        for k in range(1, reach):
            for j in range(columns - reach + 1):
                along[i, j] = max(along[i, j], blocks[i, j + k])
    for i in range(rows - reach + 1):
        for j in range(columns):
            out[i, j] = along[i, j]
        for k in range(1, reach):
            for j in range(columns):
                out[i, j] = max(out[i, j], along[i + k, j])
