"""The map as a picture: walls and the robot's path, on a page with axes in metres."""

import math
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from gridwright_client.outputs.cropping import UNKNOWN, cropped
from gridwright_client.outputs.page import END, START, View, draw_mark, frame_page
from gridwright_client.results import OccupancyMap
from gridwright_client.se2 import Poses

_LONGEST_SIDE_PX = 2100
_MARGIN_CELLS = 10

_UNKNOWN_GREY = 212
_FREE_GREY = 255
_PATH = (32, 108, 214)

_SUPERSAMPLING = 2


def draw_map(grid: OccupancyMap, path: Poses, title: str, target: Path) -> None:
    """Writes a PNG of the observed part of the map with the path, shape (n, 3), drawn over it.

    Its drawing area is at most 2100 pixels long; a map of more cells is reduced so that walls stay.
    """
    image, view = _map_image(_with_margin(grid))
    if len(path):
        _draw_path(image, view.pixel(path[:, :2]), view)
    frame_page(image, view, title, _subtitle(grid, path)).save(target)


def _subtitle(grid: OccupancyMap, path: Poses) -> str:
    length_m = float(np.hypot(*np.diff(path[:, :2], axis=0).T).sum()) if len(path) > 1 else 0.0
    return f"cells of {grid.resolution_m * 100:g} cm, path of {length_m:.0f} m"


def _with_margin(grid: OccupancyMap) -> OccupancyMap:
    box = cropped(grid)
    cells = np.pad(box.cells, _MARGIN_CELLS, constant_values=UNKNOWN)
    return OccupancyMap(
        cells,
        box.resolution_m,
        box.min_column - _MARGIN_CELLS,
        box.min_row - _MARGIN_CELLS,
        box.stamp_ns,
        box.version,
    )


def _map_image(grid: OccupancyMap) -> tuple[Image.Image, View]:
    rows, columns = grid.cells.shape
    longest = max(rows, columns)
    shrink = math.ceil(longest / _LONGEST_SIDE_PX)
    grey = _grey(grid.cells)[::-1]
    if shrink > 1:
        grey = _darkest(grey, shrink)
    enlarge = max(1, _LONGEST_SIDE_PX // max(grey.shape))
    image = Image.fromarray(np.ascontiguousarray(grey)).convert("RGB")
    if enlarge > 1:  # whole cells, so that edges stay crisp
        image = image.resize((image.width * enlarge, image.height * enlarge), Image.Resampling.NEAREST)
    view = View(
        min_x_m=grid.min_column * grid.resolution_m,
        max_y_m=(grid.min_row + rows) * grid.resolution_m,
        pixels_per_m=enlarge / (shrink * grid.resolution_m),
        width_px=image.width,
        height_px=image.height,
    )
    return image, view


def _grey(cells: NDArray[np.int8]) -> NDArray[np.uint8]:
    """White where free, black where occupied, light grey where unknown."""
    table = np.full(256, _UNKNOWN_GREY, dtype=np.uint8)
    percent = np.arange(101)
    table[:101] = np.interp(percent, (0, 25, 49, 51, 75, 100), (_FREE_GREY, 252, 240, 190, 60, 0))
    return np.asarray(table[cells.view(np.uint8)])


def _darkest(grey: NDArray[np.uint8], shrink: int) -> NDArray[np.uint8]:
    """One pixel per block of shrink x shrink: the wall in it, if it holds one."""
    rows, columns = (math.ceil(size / shrink) * shrink for size in grey.shape)
    padding = ((0, rows - grey.shape[0]), (0, columns - grey.shape[1]))
    padded = np.pad(grey, padding, constant_values=_UNKNOWN_GREY)
    blocks = padded.reshape(rows // shrink, shrink, columns // shrink, shrink)
    darkest = blocks.min(axis=(1, 3))
    # Unknown must not spread over free space as walls do.
    mean = blocks.mean(axis=(1, 3)).astype(np.uint8)
    return np.asarray(np.where(darkest < _UNKNOWN_GREY, darkest, mean))


def _draw_path(image: Image.Image, points_px: NDArray[np.float64], view: View) -> None:
    """Smooth lines: drawn as a mask at twice the size, then reduced."""
    scale = _SUPERSAMPLING
    mask = Image.new("L", (view.width_px * scale, view.height_px * scale))
    line = [(x * scale, y * scale) for x, y in points_px.tolist()]
    if len(line) > 1:
        ImageDraw.Draw(mask).line(line, fill=210, width=round(view.text_px / 9 * scale), joint="curve")
    image.paste(_PATH, mask=mask.resize(image.size, Image.Resampling.BOX))
    draw = ImageDraw.Draw(image)
    for (x, y), colour in ((points_px[0], START), (points_px[-1], END)):
        draw_mark(draw, (x, y), view.text_px * 0.45, colour)
