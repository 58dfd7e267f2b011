import numpy as np
import pytest
from click.testing import CliRunner
from gridwright_client.carmen import read_log
from gridwright_client.cli.simulate import simulate as simulate_command
from gridwright_client.evaluation import evaluate, read_relations
from gridwright_client.simulation import SimulationOptions, run_simulation, write_simulation
from gridwright_client.simulation.building import Building, office_floor
from gridwright_client.simulation.sensors import cast_rays
from gridwright_client.trajectory_file import TimedPoses, read_trajectory


@pytest.fixture(scope="module")
def simulation():
    return run_simulation(SimulationOptions(seed=5))


@pytest.fixture(scope="module")
def files(simulation, tmp_path_factory):
    return write_simulation(simulation, tmp_path_factory.mktemp("simulated") / "run.clf")


def contents(files):
    return [path.read_bytes() for path in (files.log, files.truth, files.relations)]


def test_the_same_options_give_the_same_files(tmp_path):
    options = SimulationOptions(seed=3, duration_s=10.0)
    first = write_simulation(run_simulation(options), tmp_path / "first.clf")
    second = write_simulation(run_simulation(options), tmp_path / "second.clf")
    other = write_simulation(
        run_simulation(SimulationOptions(seed=4, duration_s=10.0)), tmp_path / "other.clf"
    )
    assert contents(first) == contents(second)
    assert first.log.read_bytes() != other.log.read_bytes()


def test_the_files_stand_beside_the_log(files):
    assert files.truth.name == "run.true.tum"
    assert files.relations.name == "run.relations"


def test_the_log_reads_back(simulation, files):
    log = read_log(files.log)
    assert log.malformed == []
    assert len(log.scans) == len(simulation.scan_ticks)
    assert len(log.readings) == len(simulation.stamps_ns)
    np.testing.assert_allclose(log.base_from_laser["front"], simulation.base_from_laser)
    first = simulation.ranges_m[0]
    expected = np.where(first >= simulation.range_max_m, np.inf, first)
    np.testing.assert_allclose(log.scans[0].ranges_m, expected, atol=1e-6)


@pytest.mark.parametrize("beams", [180, 181, 360, 361])
def test_the_reader_takes_the_beams_to_point_where_they_did(tmp_path, beams):
    simulation = run_simulation(SimulationOptions(beams=beams, duration_s=1.0))
    (first, *_) = read_log(write_simulation(simulation, tmp_path / "run.clf").log).scans
    pose = simulation.map_from_base[0] + (0.12 * np.cos(simulation.map_from_base[0, 2]), 0.0, 0.0)
    exact = cast_rays(office_floor(), pose, first.geometry.bearings_rad())
    seen = np.isfinite(first.ranges_m)
    assert np.median(np.abs(first.ranges_m[seen] - exact[seen])) < 0.02


def test_truth_scores_nothing_and_odometry_badly(files):
    relations = read_relations(files.relations)
    truth = evaluate(read_trajectory(files.truth), relations, max_dt_s=0.0005)
    assert truth.missed == 0
    assert truth.translation_m.largest < 1e-5
    assert truth.rotation_deg.largest < 1e-3
    scans = read_log(files.log).scans
    odometry = TimedPoses(
        np.array([scan.stamp_ns for scan in scans]), np.array([scan.odom_from_base for scan in scans])
    )
    raw = evaluate(odometry, relations, max_dt_s=0.0005)
    assert raw.translation_m.mean > 0.3
    assert raw.translation_m.largest > 3.0


def test_there_are_relations_between_visits_of_the_same_place(files):
    relations = read_relations(files.relations)
    apart_s = (relations.second_ns - relations.first_ns) * 1e-9
    assert (apart_s > 30.0).sum() > 50
    assert (apart_s < 5.0).sum() > 100
    assert np.hypot(*relations.first_from_second[:, :2].T).max() < 1.1


def test_the_robot_drives_far_and_keeps_clear_of_walls(simulation):
    assert 100.0 < simulation.path_m < 150.0
    assert 180.0 < len(simulation.stamps_ns) / 16 < 260.0
    assert office_floor().clearance_m(simulation.map_from_base[:, :2]).min() > 0.3


def test_more_laps_are_a_longer_way(simulation):
    longer = run_simulation(SimulationOptions(laps=3, duration_s=400.0))
    assert longer.path_m > simulation.path_m + 35.0


def test_rays_end_at_the_first_wall():
    box = Building(np.array([[(2, -1), (2, 1)], [(3, -1), (3, 1)], [(-1, -5), (-1, 5)]], dtype=np.float64))
    ranges = cast_rays(box, np.array((0.0, 0.0, 0.0)), np.radians((0.0, 20.0, 60.0, 180.0)))
    np.testing.assert_allclose(ranges, (2.0, 2.0 / np.cos(np.radians(20.0)), np.inf, 1.0))


def test_command(tmp_path):
    result = CliRunner().invoke(simulate_command, [str(tmp_path / "made.clf"), "--duration", "5"])
    assert result.exit_code == 0
    assert "made.relations" in result.output
    assert len(read_log(tmp_path / "made.clf").scans) == 41


def test_command_names_a_place_it_cannot_write_to(tmp_path):
    (tmp_path / "file").write_text("")
    result = CliRunner().invoke(simulate_command, [str(tmp_path / "file" / "x.clf"), "--duration", "1"])
    assert result.exit_code == 2
    assert len(result.output.splitlines()) == 1
