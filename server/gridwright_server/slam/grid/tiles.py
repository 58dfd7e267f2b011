"""Tiles: the maps of all particles in one pool, shared copy-on-write.

The lattice is fixed: cell (column, row) covers [column, column + 1) x [row, row + 1) times the
resolution, for as long as the map lives. Cells come in square tiles. Each particle has a page table
that names the tile at each place; -1 where nothing was mapped. Resampling copies page tables; a tile
is copied when one of its several owners writes to it.

Invariant: `references[tile]` is the number of page tables and snapshots that name the tile; a tile
with none is on the free list.
"""

from collections import deque
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gridwright_server.jit import kernel

NO_TILE = -1
UNKNOWN = -32768
"""Log-odds of a cell that no beam has crossed or hit."""
MINIMUM_TILE_CELLS = 32


class TileArrays(NamedTuple):
    """What a tile holds; first axis: the tile."""

    log_odds: NDArray[np.int16]
    """shape (capacity, cells, cells), in units of LOG_ODDS_UNIT; UNKNOWN where nothing is known"""
    field: NDArray[np.uint8]
    """shape (capacity, cells, cells): the likelihood field, see grid.likelihood"""
    blocks: NDArray[np.uint8]
    """shape (capacity, blocks, blocks): maximum of the field over each block of cells"""


class TilePool:
    """Storage of tiles, reference counts and the free list."""

    def __init__(self, tile_cells: int, block_cells: int, capacity: int = 256) -> None:
        self.tile_cells = tile_cells
        self.block_cells = block_cells
        blocks = tile_cells // block_cells
        self.arrays = TileArrays(
            np.empty((capacity, tile_cells, tile_cells), np.int16),
            np.empty((capacity, tile_cells, tile_cells), np.uint8),
            np.empty((capacity, blocks, blocks), np.uint8),
        )
        self.references: NDArray[np.int32] = np.zeros(capacity, np.int32)
        self._free: NDArray[np.int32] = np.arange(capacity - 1, -1, -1, dtype=np.int32)
        self._free_count = capacity
        self._given_back: deque[NDArray[np.int32]] = deque()

    @property
    def used(self) -> int:
        """Tiles that somebody owns."""
        return len(self.references) - self._free_count

    def reserve(self, tiles: int) -> None:
        """Makes room for this many more tiles. Arrays handed out before stay readable.

        What they hold of a tile stays as it was for as long as somebody else owns the tile too.
        """
        while self._given_back:
            self.release(self._given_back.popleft())
        if self._free_count >= tiles:
            return
        old = len(self.references)
        capacity = max(2 * old, old + tiles)
        self.arrays = TileArrays(*(_grown(array, capacity) for array in self.arrays))
        self.references = _grown(self.references, capacity)
        self.references[old:] = 0
        fresh = np.arange(capacity - 1, old - 1, -1, dtype=np.int32)
        free = self._free[: self._free_count]
        self._free = np.empty(capacity, np.int32)
        self._free[: len(fresh)] = fresh
        self._free[len(fresh) : len(fresh) + len(free)] = free
        self._free_count = len(fresh) + len(free)

    def make_writable(self, table: NDArray[np.int32], wanted: NDArray[np.bool_]) -> None:
        """Gives a page table a tile of its own wherever `wanted`; both shape (tile rows, tile columns)."""
        self.reserve(int(np.count_nonzero(wanted)))
        self._free_count = _make_writable(
            self.arrays, self.references, self._free, self._free_count, table, wanted
        )

    def retain(self, tiles: NDArray[np.int32], owners: int = 1) -> None:
        """Counts that many more owners for each tile named once; NO_TILE is passed over."""
        self.references[tiles[tiles != NO_TILE]] += owners

    def give_back(self, tiles: NDArray[np.int32]) -> None:
        """As release, from any thread: takes effect when the filter next needs tiles."""
        self._given_back.append(tiles)

    def release(self, tiles: NDArray[np.int32]) -> None:
        """Counts one owner less; what nobody owns any more is free. Only for the filter's own thread."""
        self._free_count = _release(self.references, self._free, self._free_count, tiles.ravel())


def _grown(array: NDArray[Any], capacity: int) -> NDArray[Any]:
    grown = np.empty((capacity, *array.shape[1:]), array.dtype)
    grown[: len(array)] = array
    return grown


@kernel
def _make_writable(arrays, references, free, free_count, table, wanted):
    for row in range(table.shape[0]):
        for column in range(table.shape[1]):
            if not wanted[row, column]:
                continue
            tile = table[row, column]
            if tile != NO_TILE and references[tile] == 1:
                continue
            free_count -= 1
            own = free[free_count]
            if tile == NO_TILE:
                arrays.log_odds[own] = UNKNOWN
                arrays.field[own] = 0
                arrays.blocks[own] = 0
            else:
                arrays.log_odds[own] = arrays.log_odds[tile]
                arrays.field[own] = arrays.field[tile]
                arrays.blocks[own] = arrays.blocks[tile]
                references[tile] -= 1
            references[own] = 1
            table[row, column] = own
    return free_count


@kernel
def _release(references, free, free_count, tiles):
    for tile in tiles:
        if tile == NO_TILE:
            continue
        references[tile] -= 1
        if references[tile] == 0:
            free[free_count] = tile
            free_count += 1
    return free_count
