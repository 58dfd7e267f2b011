"""Replays against a real server around a fake mapper."""

import json
import os
import signal
import threading
import time

import numpy as np
import pytest
from carmen_lines import flaser, odom, rawlaser, robotlaser, write
from click.testing import CliRunner
from gridwright.v1.sensor_pb2 import LaserScan
from gridwright_client.carmen import read_log
from gridwright_client.cli.replay import replay
from gridwright_client.replay.events import (
    NoOdometryError,
    OdometryEvent,
    ScanEvent,
    events_of,
    robot_seconds,
    sensor_items,
)
from gridwright_client.replay.window import SendingWindow
from gridwright_client.trajectory_file import read_trajectory


def made_log(path, scans=30):
    lines = ["PARAM robot_frontlaser_offset 0.2 nohost 0"]
    for index in range(scans):
        seconds = f"{1000 + 0.1 * index:.6f}"
        lines.append(odom(x=0.1 * index, seconds=seconds))
        lines.append(flaser([1.0, 2.0, 3.0, 90.0], base=(0.1 * index, 0.0, 0.0), seconds=seconds))
    return write(path, [*lines, "ODOM 1 2", "SYNC 1"])


def run(*arguments):
    return CliRunner().invoke(replay, [str(argument) for argument in arguments])


def replay_made(fake_server, tmp_path, *options, scans=30):
    log = made_log(tmp_path / "made.clf", scans)
    result = run(log, "--server", fake_server.address, "--out", tmp_path / "out", *options)
    assert result.exit_code == 0, result.output
    return result, json.loads((tmp_path / "out" / "report.json").read_text())


def test_everything_is_written(fake_server, tmp_path):
    result, report = replay_made(fake_server, tmp_path, "--particles", 7, "--seed", 12)
    names = {path.name for path in (tmp_path / "out").iterdir()}
    trajectories = {"trajectory.tum", "online.tum", "odometry.tum"}
    assert names == trajectories | {"map.pgm", "map.yaml", "map.png", "report.json"}
    assert str(tmp_path / "out" / "map.png") in result.output
    for name in trajectories:
        assert len(read_trajectory(tmp_path / "out" / name)) == 30
    assert report["scans"] == {"PROCESSED": 20, "SKIPPED_BELOW_MOTION_THRESHOLD": 10}
    assert report["odometry"] == {"PROCESSED": 60}
    assert report["seed"] == 12
    assert report["configuration"]["particles"] == 7
    assert report["log"] == "made"
    assert report["log_content"]["malformed_lines"] == 1
    assert report["log_content"]["first_malformed_lines"][0]["line"] == 62
    assert report["log_content"]["ignored_messages"] == {"SYNC": 1}
    assert report["robot_seconds"] == pytest.approx(2.9)
    assert report["times_real_time"] == pytest.approx(2.9 / report["wall_seconds"])
    assert report["peak_rss_bytes"] > 10_000_000
    assert len(report["map"]["sha256"]) == 64
    assert not report["interrupted"]


def test_the_mapper_sees_the_log(fake_server, tmp_path):
    replay_made(fake_server, tmp_path)
    (mapper,) = fake_server.mappers
    assert [scan.stamp_ns for scan in mapper.scans] == [
        1_000_000_000_000 + 100_000_000 * index for index in range(30)
    ]
    scan = mapper.scans[0]
    assert np.isinf(scan.ranges_m[3])
    np.testing.assert_allclose(scan.base_from_laser, (0.2, 0.0, 0.0))
    np.testing.assert_allclose(scan.bearings_rad, -np.pi / 2 + np.pi / 4 * np.arange(4))


def test_the_same_log_and_seed_give_the_same_map_and_trajectory(fake_server, tmp_path):
    files = ("trajectory.tum", "online.tum", "odometry.tum", "map.pgm")
    _, first = replay_made(fake_server, tmp_path)
    contents = [(tmp_path / "out" / name).read_bytes() for name in files]
    _, second = replay_made(fake_server, tmp_path)
    assert first["map"] == second["map"]
    assert contents == [(tmp_path / "out" / name).read_bytes() for name in files]


def test_configuration_and_particles_combine(fake_server, tmp_path):
    config = tmp_path / "made.toml"
    config.write_text("particles = 3\n[grid]\nresolution_meters = 0.08\n")
    _, report = replay_made(fake_server, tmp_path, "--config", config, "--particles", 4)
    assert report["configuration"]["particles"] == 4
    assert report["configuration"]["grid"]["resolution_meters"] == 0.08


def test_paced_replays_take_their_time(fake_server, tmp_path):
    _, report = replay_made(fake_server, tmp_path, "--speed", 10)
    assert report["wall_seconds"] > 0.28
    assert report["times_real_time"] <= 10.4


def test_an_interrupt_writes_what_has_been_mapped(fake_server, tmp_path):
    def interrupt():
        deadline_s = time.monotonic() + 20.0
        while time.monotonic() < deadline_s:
            if fake_server.mappers and len(fake_server.mappers[0].scans) >= 3:
                os.kill(os.getpid(), signal.SIGINT)
                return
            time.sleep(0.01)

    threading.Thread(target=interrupt, daemon=True).start()
    result, report = replay_made(fake_server, tmp_path, "--speed", 1, scans=600)
    assert "Interrupted" in result.output
    assert report["interrupted"]
    scans = sum(report["scans"].values())
    assert 3 <= scans < 300
    assert len(read_trajectory(tmp_path / "out" / "trajectory.tum")) == scans


def events(path, *lines):
    return events_of(read_log(write(path / "made.clf", lines)))


def test_each_sweep_follows_odometry_of_its_own_time(tmp_path):
    found = events(tmp_path, odom(x=1.0, seconds="5.0"), flaser([1.0], (2.0, 0.0, 0.0), seconds="4.9"))
    assert [type(event) for event in found] == [OdometryEvent, OdometryEvent, ScanEvent]
    assert found[1].stamp_ns == found[2].stamp_ns == 4_900_000_000
    assert found[1].odom_from_base.tolist() == [2.0, 0.0, 0.0]


def test_a_sweep_without_odometry_gets_it_from_the_readings_around_it(tmp_path):
    around = [odom(x=0.0, seconds="10.0"), rawlaser([1.0], seconds="10.25"), odom(x=2.0, seconds="11.0")]
    scan = next(event for event in events(tmp_path, *around) if isinstance(event, ScanEvent))
    np.testing.assert_allclose(scan.odom_from_base, (0.5, 0.0, 0.0), atol=1e-12)


def test_sweeps_beyond_all_odometry_take_the_nearest(tmp_path):
    found = events(
        tmp_path,
        rawlaser([1.0], seconds="9.0"),
        odom(x=1.0, seconds="10.0"),
        odom(x=2.0, seconds="11.0"),
        rawlaser([1.0], seconds="12.0"),
    )
    scans = [event for event in found if isinstance(event, ScanEvent)]
    assert [scan.odom_from_base[0] for scan in scans] == [1.0, 2.0]


def test_a_sweep_that_was_logged_twice_is_sent_once(tmp_path):
    found = events(tmp_path, rawlaser([1.0, 2.0]), robotlaser([1.0, 2.0]), rawlaser([1.0, 3.0]))
    scans = [event for event in found if isinstance(event, ScanEvent)]
    assert [scan.reading.line_number for scan in scans] == [2, 3]


def test_scans_without_any_odometry_cannot_be_mapped(tmp_path):
    with pytest.raises(NoOdometryError):
        events(tmp_path, rawlaser([1.0]))


def test_two_lasers_are_told_apart(tmp_path):
    found = events(tmp_path, flaser([1.0] * 4), flaser([2.0] * 4, name="RLASER"))
    items = list(sensor_items(found, SendingWindow(threading.Event()), None))
    scans = [item.scan for item in items if item.HasField("scan")]
    assert [scan.sensor_id for scan in scans] == ["front", "rear"]
    assert all(isinstance(scan, LaserScan) for scan in scans)
    assert [item.sequence_number for item in items] == [1, 2, 3, 4]


def test_robot_time_is_from_the_earliest_to_the_latest_stamp(tmp_path):
    assert robot_seconds(events(tmp_path, *(odom(seconds=s) for s in ("7.0", "6.5", "9.0")))) == 2.5


def test_a_sender_does_not_run_far_ahead_of_the_answers(tmp_path):
    found = events(tmp_path, *(odom() for _ in range(600)))
    window = SendingWindow(threading.Event())
    items = sensor_items(found, window, None)
    assert len([next(items) for _ in range(512)]) == 512
    late = threading.Timer(0.2, window.answered)
    late.start()
    started_s = time.monotonic()
    assert next(items).sequence_number == 513
    assert time.monotonic() - started_s > 0.1
    window.close()
    assert list(items) == []


def assert_one_line(result, *parts):
    assert result.exit_code == 2, result.output
    (line,) = result.output.splitlines()
    assert line.startswith("Error: ")
    for part in parts:
        assert part in line


def test_a_missing_log(tmp_path):
    assert_one_line(run(tmp_path / "gone.clf"), "gone.clf", "No such file")


def test_a_folder_is_no_log(tmp_path):
    assert_one_line(run(tmp_path), "Is a directory")


def test_a_file_without_scans_is_no_log(tmp_path):
    path = tmp_path / "made.clf"
    path.write_bytes(b"\x89PNG\r\n\x1a\n")
    assert_one_line(run(path), "not a CARMEN log", "line 1")


@pytest.mark.parametrize(
    "content", [b"", b"hello\n", b"# a comment\n", b"PARAM robot_front_laser_max 80 nohost 0\n"]
)
def test_nor_is_one_in_which_no_line_is_wrong(tmp_path, content):
    path = tmp_path / "made.clf"
    path.write_bytes(content)
    assert_one_line(run(path), "not a CARMEN log")


def test_a_log_without_odometry(tmp_path):
    assert_one_line(run(write(tmp_path / "made.clf", [rawlaser([1.0])])), "no odometry")


def test_an_unreachable_server(tmp_path, monkeypatch):
    monkeypatch.setattr("gridwright_client.cli.replay_session.CONNECT_TIMEOUT_S", 0.3)
    result = run(made_log(tmp_path / "made.clf"), "--server", "127.0.0.1:9", "--out", tmp_path / "out")
    assert_one_line(
        CliRunnerResult(result.exit_code, result.output.splitlines()[-1]), "127.0.0.1:9", "gridwright serve"
    )


class CliRunnerResult:
    """The last line alone, where others tell what is going on before."""

    def __init__(self, exit_code, output):
        self.exit_code = exit_code
        self.output = output


def test_a_bad_configuration(tmp_path):
    (tmp_path / "made.toml").write_text("particels = 3")
    log = made_log(tmp_path / "made.clf")
    assert_one_line(run(log, "--config", tmp_path / "made.toml"), "did you mean particles")


def test_a_configuration_that_the_server_refuses(fake_server, tmp_path):
    (tmp_path / "made.toml").write_text("[grid]\nresolution_meters = 99.0")
    log = made_log(tmp_path / "made.clf")
    result = run(
        log, "--server", fake_server.address, "--out", tmp_path / "out", "--config", tmp_path / "made.toml"
    )
    last = CliRunnerResult(result.exit_code, result.output.splitlines()[-1])
    assert_one_line(last, "config.grid.resolution_meters", "99")


def test_an_output_folder_that_cannot_be(tmp_path):
    (tmp_path / "file").write_text("")
    result = run(made_log(tmp_path / "made.clf"), "--out", tmp_path / "file" / "out")
    assert_one_line(result, "--out")


@pytest.mark.parametrize("speed", ["0", "-1", "fast", "inf", "nan"])
def test_a_speed_that_makes_no_sense(tmp_path, speed):
    result = run(made_log(tmp_path / "made.clf"), "--speed", speed)
    assert result.exit_code == 2
    assert "neither max nor a positive number" in result.output


def test_threads_are_for_a_server_of_ones_own(tmp_path):
    log = made_log(tmp_path / "made.clf")
    assert_one_line(run(log, "--server", "127.0.0.1:9", "--threads", 2), "gridwright serve")
