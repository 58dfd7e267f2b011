"""The floor plan: an office floor of 25 m x 18 m, rooms on both sides of a corridor that is a loop.

No two rooms are alike and the corridor has pillars and cabinets: in a symmetric building even a
perfect mapper could not tell where it is.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

_DOOR_M = 1.0

Point = tuple[float, float]


@dataclass(frozen=True)
class Building:
    """Walls and furniture."""

    walls: NDArray[np.float64]
    """shape (walls, 2, 2): both ends of each, x and y in m."""

    def clearance_m(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """The distance of each point, shape (n, 2), to the nearest wall; shape (n,)."""
        start, along = self.walls[:, 0], self.walls[:, 1] - self.walls[:, 0]
        offset = points[:, np.newaxis] - start
        share = np.clip((offset * along).sum(-1) / (along**2).sum(-1), 0.0, 1.0)
        return np.asarray(np.linalg.norm(offset - share[..., np.newaxis] * along, axis=-1).min(axis=1))


def office_floor() -> Building:
    """The corridor lies between the rectangles (4.5, 4.5)-(20.5, 13.5) and (6.5, 6.5)-(18.5, 11.5)."""
    segments = [
        *_box(0.0, 0.0, 25.0, 18.0),
        # Around the corridor; doors by the coordinate of their middle.
        *_wall((4.5, 4.5), (20.5, 4.5), doors=(7.0, 11.8, 17.6)),
        *_wall((4.5, 13.5), (20.5, 13.5), doors=(6.2, 13.0, 18.4)),
        *_wall((4.5, 4.5), (4.5, 13.5), doors=(10.4,)),
        *_wall((20.5, 4.5), (20.5, 13.5), doors=(7.4, 12.3)),
        # The rooms inside the loop.
        *_wall((6.5, 6.5), (18.5, 6.5), doors=(9.3,)),
        *_wall((6.5, 11.5), (18.5, 11.5), doors=(15.8,)),
        *_wall((6.5, 6.5), (6.5, 11.5)),
        *_wall((18.5, 6.5), (18.5, 11.5)),
        *_wall((12.2, 6.5), (12.2, 11.5), doors=(8.1,)),
        # Between the outer rooms.
        *_wall((9.2, 0.0), (9.2, 4.5)),
        *_wall((14.6, 0.0), (14.6, 4.5), doors=(1.4,)),
        *_wall((9.8, 13.5), (9.8, 18.0)),
        *_wall((16.1, 13.5), (16.1, 18.0)),
        *_wall((0.0, 6.8), (4.5, 6.8)),
        *_wall((0.0, 13.5), (4.5, 13.5)),
        *_wall((20.5, 4.5), (25.0, 4.5)),
        *_wall((20.5, 9.9), (25.0, 9.9)),
        # Pillars and cabinets along the corridor.
        *_box(8.6, 13.2, 9.3, 13.5),
        *_box(15.2, 4.5, 15.6, 4.8),
        *_box(4.5, 8.0, 4.8, 8.9),
        *_box(18.5, 8.6, 18.75, 9.4),
        *_box(13.2, 6.2, 14.1, 6.5),
        *_box(10.7, 11.5, 11.0, 11.75),
        *_box(20.2, 10.1, 20.5, 10.5),
        # Desks, shelves and tables.
        *_box(0.0, 2.2, 0.8, 4.4),
        *_box(3.4, 0.0, 5.2, 0.75),
        *_box(7.9, 1.0, 8.5, 2.2),
        *_box(10.0, 0.6, 11.3, 1.5),
        *_box(13.4, 3.4, 14.6, 4.2),
        *_box(19.0, 0.0, 20.8, 0.9),
        *_box(22.4, 2.4, 23.5, 3.3),
        *_box(22.9, 5.0, 24.2, 5.7),
        *_box(24.4, 7.2, 25.0, 9.2),
        *_box(22.2, 12.6, 23.2, 14.1),
        *_box(17.0, 17.3, 19.4, 18.0),
        *_box(20.0, 15.4, 20.9, 16.1),
        *_box(10.4, 16.9, 11.6, 17.5),
        *_box(14.6, 15.2, 15.5, 16.4),
        *_box(1.2, 15.0, 2.6, 15.8),
        *_box(7.4, 16.8, 8.9, 17.4),
        *_box(0.9, 8.0, 1.9, 9.0),
        *_box(0.0, 11.6, 0.6, 13.0),
        *_box(7.2, 9.6, 8.4, 10.6),
        *_box(10.9, 10.5, 12.2, 11.3),
        *_box(16.7, 7.0, 17.9, 8.0),
        *_box(12.9, 9.8, 13.6, 10.8),
    ]
    return Building(np.array(segments))


def _wall(start: Point, end: Point, doors: Sequence[float] = ()) -> list[tuple[Point, Point]]:
    """A wall along an axis, from the lower to the higher end, with gaps for doors."""
    axis = 0 if start[1] == end[1] else 1
    edges = [start[axis], *(side for door in doors for side in _jambs(door)), end[axis]]
    pieces = zip(edges[::2], edges[1::2], strict=True)
    if axis == 0:
        return [((low, start[1]), (high, start[1])) for low, high in pieces]
    return [((start[0], low), (start[0], high)) for low, high in pieces]


def _jambs(door: float) -> Point:
    return door - _DOOR_M / 2, door + _DOOR_M / 2


def _box(left: float, bottom: float, right: float, top: float) -> list[tuple[Point, Point]]:
    corners = [(left, bottom), (right, bottom), (right, top), (left, top)]
    return list(zip(corners, [*corners[1:], corners[0]], strict=True))
