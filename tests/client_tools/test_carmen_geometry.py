import math

import numpy as np
import pytest
from carmen_lines import flaser, robotlaser, write
from gridwright_client.carmen import read_log
from gridwright_client.carmen.geometry import beam_geometry
from gridwright_client.carmen.messages import DeclaredBeams

HALF_TURN = math.pi


@pytest.mark.parametrize(
    ("beams", "increment_deg", "last_deg"),
    [
        (180, 1.0, 89.0),
        (181, 1.0, 90.0),
        (360, 0.5, 89.5),
        (361, 0.5, 90.0),
        (90, 2.0, 88.0),
        (721, 0.25, 90.0),
    ],
)
def test_beams_by_their_number(beams, increment_deg, last_deg):
    geometry = beam_geometry(beams, "front", None, {})
    bearings = np.degrees(geometry.bearings_rad())
    assert len(bearings) == beams
    assert bearings[0] == -90.0
    assert math.degrees(geometry.increment_rad) == pytest.approx(increment_deg)
    assert bearings[-1] == pytest.approx(last_deg)


def test_the_resolution_parameter_wins():
    geometry = beam_geometry(361, "front", None, {"laser_front_laser_resolution": "0.25"})
    assert math.degrees(geometry.increment_rad) == pytest.approx(0.25)
    assert geometry.first_bearing_rad == -HALF_TURN / 2


@pytest.mark.parametrize("value", ["", "on", "0", "-1", "nan"])
def test_a_resolution_that_makes_no_sense_is_passed_over(value):
    geometry = beam_geometry(180, "front", None, {"laser_front_laser_resolution": value})
    assert math.degrees(geometry.increment_rad) == pytest.approx(1.0)


def test_the_rear_laser_has_its_own_parameter():
    parameters = {"laser_front_laser_resolution": "1.0", "laser_rear_laser_resolution": "0.5"}
    assert math.degrees(beam_geometry(361, "rear", None, parameters).increment_rad) == pytest.approx(0.5)


def test_what_the_message_says_of_its_beams_counts():
    declared = DeclaredBeams(-2.0, 4.0, 0.02, 30.0)
    geometry = beam_geometry(201, "front", declared, {"laser_front_laser_resolution": "1.0"})
    assert (geometry.first_bearing_rad, geometry.increment_rad) == (-2.0, 0.02)


def test_a_message_without_resolution_spreads_its_beams_over_the_view():
    geometry = beam_geometry(201, "front", DeclaredBeams(-2.0, 4.0, 0.0, 30.0), {})
    assert geometry.bearings_rad()[-1] == pytest.approx(2.0)


def test_single_beams_are_no_error():
    assert beam_geometry(1, "front", None, {}).bearings_rad().tolist() == [-math.pi / 2]
    assert len(beam_geometry(0, "front", None, {}).bearings_rad()) == 0


def mounting(tmp_path, *lines):
    return read_log(write(tmp_path / "made.clf", lines)).base_from_laser["front"]


def test_mounting_from_parameters(tmp_path):
    lines = [
        "PARAM robot_frontlaser_offset 0.3 nohost 0",
        "PARAM robot_frontlaser_side_offset 0.1 nohost 0",
        "PARAM robot_frontlaser_angular_offset 90 nohost 0",
        flaser([1.0], base=(0.0, 0.0, 0.0), laser=(0.5, 0.0, 0.0)),
    ]
    np.testing.assert_allclose(mounting(tmp_path, *lines), (0.3, 0.1, HALF_TURN / 2))


def test_without_parameters_the_two_poses_of_the_message_tell_the_mounting(tmp_path):
    turned = [(1.0, 2.0, HALF_TURN / 2), (1.0, 2.25, HALF_TURN / 2)]
    lines = [flaser([1.0], (0, 0, 0), (0.25, 0, 0)), flaser([1.0], *turned)]
    np.testing.assert_allclose(mounting(tmp_path, *lines), (0.25, 0.0, 0.0), atol=1e-9)


def test_corrected_laser_poses_are_no_mounting(tmp_path):
    lines = [flaser([1.0], (0.0, 0.0, 0.0), (0.1 * step, 0.0, 0.0)) for step in range(20)]
    assert mounting(tmp_path, *lines).tolist() == [0.0, 0.0, 0.0]


def test_rounded_poses_give_one_mounting(tmp_path):
    rng = np.random.default_rng(3)
    lines = []
    for theta in rng.uniform(-3.1, 3.1, 50):
        base = (10.0, 20.0, round(theta, 6))
        laser = (round(10 + 0.2 * math.cos(theta), 6), round(20 + 0.2 * math.sin(theta), 6), base[2])
        lines.append(robotlaser([1.0], base, laser))
    np.testing.assert_allclose(mounting(tmp_path, *lines), (0.2, 0.0, 0.0), atol=2e-6)
