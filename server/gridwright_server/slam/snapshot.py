"""A particle's map at one moment, read while the filter goes on."""

from contextlib import suppress

import numpy as np
from numpy.typing import NDArray

from gridwright_server.slam.grid.lattice import PageTables
from gridwright_server.slam.grid.occupancy import occupancy_percent
from gridwright_server.slam.grid.tiles import NO_TILE, TilePool


class TileSnapshot:
    """Owns the tiles of one page table, as a particle would: whoever writes to one copies it first.

    Taken by the filter's own thread; read and closed by any.
    """

    def __init__(
        self,
        pool: TilePool,
        pages: PageTables,
        particle: int,
        resolution_m: float,
        stamp_ns: int,
        revision: int,
        generation: int,
    ) -> None:
        table = pages.tables[particle]
        rows, columns = np.nonzero(table != NO_TILE)
        self._tiles: NDArray[np.int32] = table[rows, columns]
        pool.retain(self._tiles)
        self._owned = [self._tiles]
        self._pool = pool
        self._log_odds = pool.arrays.log_odds
        self.stamp_ns, self.revision, self.generation = stamp_ns, revision, generation
        self.resolution_m, self.tile_cells = resolution_m, pool.tile_cells
        origins = np.stack([columns + pages.window.column_begin, rows + pages.window.row_begin], axis=1)
        self.tile_origins: NDArray[np.int32] = (origins * pool.tile_cells).astype(np.int32)

    def occupancy(self, tile: int) -> NDArray[np.int8]:
        """shape (tile_cells, tile_cells), [row, column]: -1 unknown, 0..100 probability in percent."""
        if not self._owned:
            raise ValueError("the snapshot is closed")
        return occupancy_percent(self._log_odds[self._tiles[tile]])

    def close(self) -> None:
        """Gives the tiles back; calling it twice is harmless, from two threads at once too."""
        with suppress(IndexError):
            self._pool.give_back(self._owned.pop())
