"""A particle's match: the search in its map, refined, and where to look when there is none."""

import math
from typing import NamedTuple

from gridwright_server.jit import kernel
from gridwright_server.slam.grid.patch import gather, reachable_maximum, tiles_reached
from gridwright_server.slam.matching.multilevel import Objective, Window, search
from gridwright_server.slam.matching.refine import CLIMB_LIMIT, climb, interpolated_sum
from gridwright_server.slam.proposal import Lattice

FULL_SCORE = 255.0
"""The field on a surface."""


class Matching(NamedTuple):
    """How to match a scan and how to draw from what is found."""

    window: Window
    wide_window: Window
    """Searched where the window holds a doubtful match, or one at its border."""
    objective: Objective
    lattice: Lattice
    minimum_score: float
    doubtful_score: float
    translation_sigma_m: float
    """Of the motion model, for particles whose match fails."""
    rotation_sigma_rad: float


@kernel
def find(maps, p, expected, view, grid, matching, patch):
    """The match and its score, and how many quarters were scored for it.

    Where the window holds a doubtful one, or one at its border, odometry may be wrong, not only noisy:
    the wide window is searched too.
    """
    match, score, at_border, quarters = _match(
        maps, p, expected, view, grid, matching, matching.window, patch
    )
    if at_border or score < matching.doubtful_score:
        match, score, _, more = _match(maps, p, expected, view, grid, matching, matching.wide_window, patch)
        quarters += more
    return match, score, quarters


@kernel
def _match(maps, p, expected, view, grid, matching, window, patch):
    """The best pose of a window around the expected one, refined.

    Returns (column, row, theta), its score, whether it lies at the window's border, and the number of
    quarters scored.
    """
    resolution = grid.resolution_m
    _lay_out(maps, p, expected, view, grid, matching.lattice, window, patch)
    found = search(patch.field, patch.level, view.points, expected, resolution, window, matching.objective)
    best = expected.copy()
    best[0] += found.column
    best[1] += found.row
    best[2] += found.step * window.angle_step_rad
    match = climb(patch.field, view.points, best, expected, resolution, window, matching.objective)
    score = mean_field(patch.field, view.points, match, resolution)
    return match, score, _is_at_border(found, window), found.quarters_scored


@kernel
def _is_at_border(found, window):
    first, last = -window.half_voxels * window.coarse, window.half_voxels * window.coarse - 1
    return found.row in (first, last) or found.column in (first, last) or abs(found.step) == window.half_steps


@kernel
def mean_field(field, points, pose, resolution_m):
    """How well a scan fits at a pose, (column, row, theta) in cells of the patch: 1 = all on surfaces."""
    total = interpolated_sum(field, points, pose[0], pose[1], pose[2], resolution_m)
    return total / (FULL_SCORE * max(len(points), 1))


@kernel
def _lay_out(maps, p, expected, view, grid, lattice, window, patch):
    """Fills a patch with what a search of the window can reach of the particle's map."""
    slack_cells = search_slack_cells(window, grid.block_cells, lattice)
    slack_rad = (window.half_steps + CLIMB_LIMIT) * window.angle_step_rad + lattice.extent[2]
    tiles_reached(view.points, expected, slack_cells, slack_rad, grid, patch.reached)
    gather(maps.arrays.field, maps.tables[p], patch.reached, patch.field)
    gather(maps.arrays.blocks, maps.tables[p], patch.reached, patch.blocks)
    reachable_maximum(patch.blocks, grid.block_cells, window.coarse, patch.scratch, patch.level.voxel)
    reachable_maximum(patch.blocks, grid.block_cells, window.quarter, patch.scratch, patch.level.quarter)


@kernel
def search_slack_cells(window: Window, block_cells: int, lattice: Lattice) -> int:
    """How far from where it falls at the predicted pose matching may look up an end point.

    The window; what a square of poses reaches beyond it, in whole blocks; then climbing, the lattice
    of the proposal and, twice, a cell for interpolation.
    """
    beyond = window.coarse + 2 * block_cells + CLIMB_LIMIT + 2
    return window.half_voxels * window.coarse + beyond + math.ceil(lattice.extent[0])
