"""Maps as files; Nav2's rule for reading them is written down here once more."""

import hashlib

import numpy as np
import pytest
from gridwright.v1.mapping_service_pb2 import MapVersion
from gridwright_client.outputs import cropped, draw_map, map_sha256, write_nav2_map
from gridwright_client.results import OccupancyMap
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from PIL import Image


def grid(cells, min_column=0, min_row=0, resolution_m=0.05):
    return OccupancyMap(np.array(cells, dtype=np.int8), resolution_m, min_column, min_row, 0, MapVersion())


def load_as_map_server_does(folder):
    """Occupancy by [row from the lowest y, column], the resolution and the origin."""
    settings = dict(line.split(": ", 1) for line in (folder / "map.yaml").read_text().splitlines())
    assert settings["mode"] == "trinary"
    assert settings["negate"] == "0"
    with Image.open(folder / settings["image"]) as image:
        pixels = np.asarray(image, dtype=np.float64)
    occupancy = (255.0 - pixels) / 255.0
    loaded = np.full(pixels.shape, -1)
    loaded[occupancy < float(settings["free_thresh"])] = 0
    loaded[occupancy > float(settings["occupied_thresh"])] = 100
    origin = [float(part) for part in settings["origin"].strip("[]").split(",")]
    return loaded[::-1], float(settings["resolution"]), origin


cells = hnp.arrays(np.int8, st.tuples(st.integers(1, 12), st.integers(1, 12)), elements=st.integers(-1, 100))


@given(cells, st.integers(-50, 50), st.integers(-50, 50))
def test_map_server_recovers_free_occupied_and_unknown(tmp_path_factory, values, column, row):
    folder = tmp_path_factory.getbasetemp()
    write_nav2_map(grid(values, column, row), folder)
    loaded, resolution, origin = load_as_map_server_does(folder)
    box = cropped(grid(values, column, row))
    if box.cells.size == 0:
        assert (loaded == -1).all()
        return
    expected = np.where(box.cells > 65, 100, np.where((box.cells >= 0) & (box.cells < 35), 0, -1))
    np.testing.assert_array_equal(loaded, expected)
    assert resolution == 0.05
    assert origin == pytest.approx([box.min_column * 0.05, box.min_row * 0.05, 0.0])


def test_cropping_keeps_cells_where_they_are():
    values = np.full((6, 7), -1)
    values[2, 3], values[4, 1] = 90, 10
    box = cropped(grid(values, min_column=-10, min_row=20))
    assert (box.min_column, box.min_row, box.cells.shape) == (-9, 22, (3, 3))
    assert box.cells[0, 2] == 90
    assert box.cells[2, 0] == 10


@given(cells, st.integers(0, 5), st.integers(0, 5))
def test_the_fingerprint_does_not_see_unknown_margins(values, columns, rows):
    padded = np.pad(values, ((rows, 1), (columns, 2)), constant_values=-1)
    assert map_sha256(grid(values, 7, 8)) == map_sha256(grid(padded, 7 - columns, 8 - rows))


def test_the_fingerprint_sees_everything_else():
    fingerprints = {
        map_sha256(grid([[10, 90]])),
        map_sha256(grid([[10, 91]])),
        map_sha256(grid([[10], [90]])),
        map_sha256(grid([[10, 90]], min_column=1)),
        map_sha256(grid([[10, 90]], min_row=1)),
        map_sha256(grid([[10, 90]], resolution_m=0.04)),
    }
    assert len(fingerprints) == 6


def test_the_fingerprint_is_made_as_documented():
    expected = hashlib.sha256(b"0.05 -3 4 2 1\n" + bytes([10, 90])).hexdigest()
    assert map_sha256(grid([[10, 90]], min_column=-3, min_row=4)) == expected


@pytest.mark.parametrize("shape", [(1, 1), (200, 300), (40, 3000), (5000, 20)])
def test_pictures_are_of_sensible_size(tmp_path, shape):
    values = np.random.default_rng(0).integers(-1, 101, shape)
    path = np.array([(0.0, 0.0, 0.0), (0.5, 0.5, 0.0)])
    draw_map(grid(values), path, "a map", tmp_path / "map.png")
    with Image.open(tmp_path / "map.png") as picture:
        width, height = picture.size
    assert 500 < max(width, height) <= 2450


def test_walls_survive_reduction(tmp_path):
    values = np.zeros((100, 6000))
    values[50] = 100  # one cell thin, of which a mean would leave a third
    draw_map(grid(values), np.zeros((0, 3)), "a wall", tmp_path / "map.png")
    with Image.open(tmp_path / "map.png") as image:
        picture = np.asarray(image.convert("L"))
    assert (picture == 0).any(axis=0).sum() > 1900


def test_empty_maps_and_paths_are_drawn_too(tmp_path):
    draw_map(grid(np.full((3, 3), -1)), np.zeros((0, 3)), "nothing", tmp_path / "map.png")
    assert (tmp_path / "map.png").stat().st_size > 0
