"""What a replay leaves on the disk."""

import json
import platform
import resource
import sys
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from google.protobuf.json_format import MessageToDict

from gridwright_client.carmen import CarmenLog
from gridwright_client.outputs import cropped, draw_map, map_sha256, write_nav2_map
from gridwright_client.replay.mapping import Mapped
from gridwright_client.trajectory_file import write_tum

_SHOWN_MALFORMED = 20
_PACKAGES = ("gridwright", "grpcio", "protobuf", "numpy", "numba")


@dataclass(frozen=True)
class ReplayRun:
    """A replay, with what it was fed."""

    name: str
    """Of the log."""
    log: CarmenLog
    mapped: Mapped
    robot_s: float
    """From the earliest to the latest time of what was replayed."""
    reading_s: float
    """Wall time that reading the log took."""
    server: str
    """Address, or "in this process"."""
    interrupted: bool


def write_outputs(run: ReplayRun, directory: Path) -> dict[str, Any]:
    """Writes the map, the trajectories and the report; returns the report. Raises OSError."""
    mapped = run.mapped
    write_nav2_map(mapped.grid, directory)
    draw_map(mapped.grid, mapped.final.poses, _title(run), directory / "map.png")
    write_tum(directory / "trajectory.tum", mapped.final)
    write_tum(directory / "online.tum", mapped.online)
    write_tum(directory / "odometry.tum", mapped.odometry)
    report = _report(run)
    (directory / "report.json").write_text(json.dumps(report, indent=2) + "\n", encoding="utf-8")
    return report


def _title(run: ReplayRun) -> str:
    session = run.mapped.session
    count = session.config.particles
    return f"{run.name}: {count} particle{'' if count == 1 else 's'}, seed {session.seed}"


def _report(run: ReplayRun) -> dict[str, Any]:
    mapped = run.mapped
    return {
        "log": run.name,
        "server": run.server,
        "session_id": mapped.session.session_id,
        "seed": mapped.session.seed,
        "configuration": MessageToDict(mapped.session.config, preserving_proto_field_name=True),
        "interrupted": run.interrupted,
        "scans": _sorted(mapped.tally.scans),
        "odometry": _sorted(mapped.tally.odometry),
        "wall_seconds": mapped.wall_s,
        "robot_seconds": run.robot_s,
        "times_real_time": run.robot_s / mapped.wall_s,
        "scans_per_second": mapped.tally.scan_count / mapped.wall_s,
        "peak_rss_bytes": peak_rss_bytes(),
        "map": _map_part(run),
        "log_content": _log_part(run),
        "versions": _versions(),
    }


def _map_part(run: ReplayRun) -> dict[str, Any]:
    box = cropped(run.mapped.grid)
    rows, columns = box.cells.shape
    return {
        "sha256": map_sha256(run.mapped.grid),
        "resolution_meters": box.resolution_m,
        "min_column": box.min_column,
        "min_row": box.min_row,
        "columns": columns,
        "rows": rows,
    }


def _log_part(run: ReplayRun) -> dict[str, Any]:
    log = run.log
    return {
        "reading_seconds": run.reading_s,
        "messages": _sorted(log.messages),
        "ignored_messages": _sorted(log.ignored),
        "malformed_lines": len(log.malformed),
        "first_malformed_lines": [
            {"line": line.line_number, "reason": line.reason} for line in log.malformed[:_SHOWN_MALFORMED]
        ],
        "base_from_laser": {
            sensor_id: dict(zip(("x_meters", "y_meters", "theta_radians"), pose.tolist(), strict=True))
            for sensor_id, pose in log.base_from_laser.items()
        },
    }


def _sorted(counts: dict[str, int]) -> dict[str, int]:
    return dict(sorted(counts.items()))


def peak_rss_bytes() -> int:
    """The most memory that this process has had in use."""
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak if sys.platform == "darwin" else peak * 1024  # kibibytes everywhere else


def _versions() -> dict[str, str]:
    versions = {"python": platform.python_version()}
    for package in _PACKAGES:
        try:
            versions[package] = version(package)
        except PackageNotFoundError:
            continue  # numba comes with the server only
    return versions
