"""From a log to a map, as a user does it: right, and the same whoever serves it with however many threads."""

import json
import subprocess
import sys
from pathlib import Path

import pytest
from gridwright_client.trajectory_file import read_trajectory

GRIDWRIGHT = str(Path(sys.executable).with_name("gridwright"))


def gridwright(*arguments):
    command = [GRIDWRIGHT, *map(str, arguments)]
    return subprocess.run(command, check=True, capture_output=True, text=True, timeout=280).stdout


def replayed(log, out, *options):
    gridwright("replay", log, "--out", out, *options)
    return json.loads((out / "report.json").read_text())


def error_m(trajectory, relations, *options):
    result = json.loads(gridwright("evaluate", trajectory, relations, "--json", *options))
    assert result["missed"] == 0
    return result["translation_m"]["mean"]


@pytest.fixture
def served():
    """A server in a process of its own, with one thread."""
    command = [GRIDWRIGHT, "serve", "--address", "127.0.0.1:0", "--threads", "1"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        process.stdout.readline()
        yield process.stdout.readline().split()[-1]  # "serving on ADDRESS"
        process.terminate()


def test_a_simulated_building(tmp_path, served):
    log = tmp_path / "building.clf"
    gridwright("simulate", log, "--duration", 100, "--beams", 361)
    options = ("--particles", 7, "--seed", 3)
    reports = [
        replayed(log, tmp_path / "two", *options, "--threads", 2),
        replayed(log, tmp_path / "four", *options, "--threads", 4),
        replayed(log, tmp_path / "served", *options, "--server", served),
    ]
    assert len({report["map"]["sha256"] for report in reports}) == 1
    trajectories = {(tmp_path / name / "trajectory.tum").read_bytes() for name in ("two", "four", "served")}
    assert len(trajectories) == 1
    relations = tmp_path / "building.relations"
    assert error_m(tmp_path / "two" / "trajectory.tum", relations) < 0.02
    assert error_m(tmp_path / "two" / "odometry.tum", relations) > 0.1


@pytest.mark.real_log
def test_the_intel_research_lab(tmp_path, served, recorded_logs):
    intel = recorded_logs / "intel"
    options = ("--particles", 10, "--seed", 1)
    embedded = replayed(intel / "intel.clf", tmp_path / "embedded", *options)
    remote = replayed(intel / "intel.clf", tmp_path / "remote", *options, "--server", served)
    assert embedded["map"]["sha256"] == remote["map"]["sha256"]

    assert sum(embedded["scans"].values()) == 4482
    assert {"PROCESSED", "SKIPPED_BELOW_MOTION_THRESHOLD"} == set(embedded["scans"])
    assert embedded["odometry"] == {"PROCESSED": 13631}
    posed, odometry = (
        read_trajectory(tmp_path / "embedded" / f"{name}.tum") for name in ("trajectory", "odometry")
    )
    assert (posed.stamps_ns == odometry.stamps_ns).all()  # every scan, in the log's order

    metric = (intel / "intel.relations", "--max-dt", "0.0005", "--odometry", intel / "intel.odometry.txt")
    assert error_m(tmp_path / "embedded" / "trajectory.tum", *metric) < 0.025
    assert error_m(tmp_path / "embedded" / "online.tum", *metric) < 0.03
