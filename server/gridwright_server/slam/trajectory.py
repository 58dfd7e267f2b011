"""The particles' trajectories, stored once where they coincide."""

import numpy as np
from numpy.typing import NDArray

COLLAPSE_EVERY = 64
"""Updates between two looks for history that all particles share."""


class Ancestry:
    """Poses of all particles at all updates, as a tree.

    Recent updates keep a pose per particle and whose child each particle is. All particles alive
    descend from one ancestor sooner or later; before that the tree is one path, and is kept as such.
    """

    def __init__(self) -> None:
        self._settled: list[NDArray[np.float64]] = []
        self._open: list[tuple[NDArray[np.float64], NDArray[np.int64]]] = []

    def __len__(self) -> int:
        return len(self._settled) + len(self._open)

    def append(self, poses: NDArray[np.float64], parents: NDArray[np.int64]) -> None:
        """One update: poses, shape (particles, 3), and each particle's index at the update before."""
        self._open.append((poses, parents))
        if len(self._open) % COLLAPSE_EVERY == 0:
            self._collapse()

    def path(self, particle: int) -> NDArray[np.float64]:
        """The poses of one particle's line, shape (updates, 3)."""
        recent = []
        for poses, parents in reversed(self._open):
            recent.append(poses[particle])
            particle = int(parents[particle])
        return np.array(self._settled + recent[::-1]).reshape(-1, 3)

    def _collapse(self) -> None:
        if not self._open:
            return
        alive = np.arange(len(self._open[-1][0]))
        for update in range(len(self._open) - 1, -1, -1):
            if len(alive) == 1:
                self._settle(update, int(alive[0]))
                return
            alive = np.unique(self._open[update][1][alive])

    def _settle(self, last: int, particle: int) -> None:
        """Updates up to `last`, at which all particles descend from `particle`, become one path."""
        path = []
        index = particle
        for poses, parents in reversed(self._open[: last + 1]):
            path.append(poses[index].copy())
            index = int(parents[index])
        self._settled += path[::-1]
        del self._open[: last + 1]
        # The next update's parents all were `particle`; nothing before them is left to index.
