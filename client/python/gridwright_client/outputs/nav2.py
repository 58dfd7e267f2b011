"""A map as Nav2's map_server loads it: an image and a description of it."""

from pathlib import Path

import numpy as np

from gridwright_client.outputs.cropping import cropped
from gridwright_client.results import OccupancyMap

FREE_PIXEL, UNKNOWN_PIXEL, OCCUPIED_PIXEL = 254, 205, 0

# A pixel's occupancy is (255 - value) / 255, and map_server takes it for occupied above one
# threshold and for free below the other: 1.0, 0.1961 and 0.0039 must fall on the right sides.
_OCCUPIED_THRESHOLD = 0.65
_FREE_THRESHOLD = 0.196

OCCUPIED_ABOVE_PERCENT = 65
FREE_BELOW_PERCENT = 35


def write_nav2_map(grid: OccupancyMap, directory: Path) -> None:
    """Writes map.pgm and map.yaml.

    A cell is occupied above 65 %, free below 35 %, and between the two as good as unknown. The
    image's first row is the highest y; the origin is the lower left corner of the lower left cell.
    """
    box = cropped(grid)
    if box.cells.size == 0:  # map_server takes no image without pixels
        box = OccupancyMap(np.full((1, 1), -1, np.int8), grid.resolution_m, 0, 0, 0, grid.version)
    rows, columns = box.cells.shape
    pixels = np.full((rows, columns), UNKNOWN_PIXEL, dtype=np.uint8)
    pixels[(box.cells >= 0) & (box.cells < FREE_BELOW_PERCENT)] = FREE_PIXEL
    pixels[box.cells > OCCUPIED_ABOVE_PERCENT] = OCCUPIED_PIXEL
    header = f"P5\n{columns} {rows}\n255\n".encode("ascii")
    (directory / "map.pgm").write_bytes(header + pixels[::-1].tobytes())
    x, y = (round(cell * box.resolution_m, 9) for cell in (box.min_column, box.min_row))
    (directory / "map.yaml").write_text(
        "image: map.pgm\n"
        "mode: trinary\n"
        f"resolution: {box.resolution_m!r}\n"
        f"origin: [{x!r}, {y!r}, 0.0]\n"
        "negate: 0\n"
        f"occupied_thresh: {_OCCUPIED_THRESHOLD}\n"
        f"free_thresh: {_FREE_THRESHOLD}\n",
        encoding="ascii",
    )
