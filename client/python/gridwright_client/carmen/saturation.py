"""Which ranges of a log mean that nothing came back.

A laser says so by a range at or beyond its maximum. Parameters or messages often name that maximum,
but not always, and not always rightly: the Intel log's SICK writes 81.83 m (an error code of its
interface), Killian Court's a handful of values from 51.01 to 51.16 m, and neither log names a maximum.
Such ranges form a shelf: the largest values of the log, close together, and far more of them than
of the values below.
"""

import numpy as np
from numpy.typing import NDArray

DEFAULT_MAXIMUM_M = 80.0
"""The farthest that the lasers of these logs can measure; a SICK writes codes above it."""

_SHELF_WIDTH = 0.004  # relative to the largest value: Killian's shelf takes 0.003
_BELOW_WIDTH = 0.02
_SMALLEST_SHELF_M = 4.0  # no laser on a robot has a shorter reach
_FEWEST_READINGS = 10
_FEWEST_SWEEPS = 10
_SMALLEST_SHARE = 0.001
_DENSITY_RATIO = 10.0


def no_return_limit_m(sweeps: list[NDArray[np.float32]], maximum_m: float | None) -> float:
    """The range from which on the readings of one laser mean no return.

    That is the smaller of the maximum (of the laser, if it is known; else 80 m) and the lower
    edge of the shelf, if there is one. A shelf holds at least ten readings, from at least ten
    sweeps, a thousandth of all, and they lie ten times as dense as the two per cent below them.
    """
    named_m = maximum_m if maximum_m is not None and maximum_m > 0.0 else DEFAULT_MAXIMUM_M
    if not sweeps:
        return named_m
    ranges_m = np.concatenate(sweeps)
    below = ranges_m[ranges_m < np.float32(named_m)]  # also drops NaN
    if below.size == 0:
        return named_m
    top_m = float(below.max())
    shelf_edge_m = top_m * (1.0 - _SHELF_WIDTH)
    shelf = below[below >= shelf_edge_m]
    if _is_shelf(shelf, below, ranges_m.size, sweeps):
        return float(shelf.min())
    return named_m


def _is_shelf(
    shelf: NDArray[np.float32], below: NDArray[np.float32], total: int, sweeps: list[NDArray[np.float32]]
) -> bool:
    edge_m, top_m = float(shelf.min()), float(shelf.max())
    if top_m < _SMALLEST_SHELF_M or shelf.size < max(_FEWEST_READINGS, _SMALLEST_SHARE * total):
        return False
    neighbours = np.count_nonzero((below < edge_m) & (below >= top_m * (1.0 - _SHELF_WIDTH - _BELOW_WIDTH)))
    if shelf.size < _DENSITY_RATIO * neighbours * _SHELF_WIDTH / _BELOW_WIDTH:
        return False
    reaching = sum(bool(np.any((sweep >= edge_m) & (sweep <= top_m))) for sweep in sweeps)
    return reaching >= _FEWEST_SWEEPS
