"""`gridwright replay`: a recorded log through a mapping server, and a map out of it."""

import time
from pathlib import Path
from typing import Any

import click
from gridwright.v1.session_service_pb2 import MapperConfig
from rich.console import Console

from gridwright_client.carmen import CarmenLog, read_log
from gridwright_client.cli.options import console, fail, os_error_text
from gridwright_client.cli.replay_session import map_events
from gridwright_client.replay.config import ConfigError, read_config
from gridwright_client.replay.events import Event, NoOdometryError, events_of, robot_seconds
from gridwright_client.replay.mapping import ReplayOptions
from gridwright_client.replay.report import ReplayRun, write_outputs


def _speed(ctx: click.Context, param: click.Parameter, value: str) -> float | None:
    """Times real time; None = as fast as the server takes it."""
    if value == "max":
        return None
    try:
        speed = float(value)
    except ValueError:
        speed = 0.0
    if not 0.0 < speed < float("inf"):
        raise click.BadParameter(f"{value!r} is neither max nor a positive number")
    return speed


@click.command()
@click.argument("log", type=click.Path(path_type=Path))
@click.option("--server", metavar="ADDRESS", help="Of a running server; else one starts in this process.")
@click.option("--particles", type=click.IntRange(1), help="Hypotheses; beats the configuration file.")
@click.option("--seed", default=0, show_default=True, type=click.IntRange(0, (1 << 64) - 1))
@click.option("--config", "config_path", type=click.Path(path_type=Path), metavar="FILE.toml")
@click.option(
    "--out", type=click.Path(file_okay=False, path_type=Path), metavar="DIR", help="[default: out/<log name>]"
)
@click.option(
    "--speed",
    "times_real_time",
    callback=_speed,
    metavar="max|K",
    default="max",
    show_default=True,
    help="K times real time, or as fast as the server takes it.",
)
@click.option(
    "--threads", type=click.IntRange(1), help="Of the server in this process.  [default: one per CPU]"
)
def replay(
    log: Path,
    server: str | None,
    particles: int | None,
    seed: int,
    config_path: Path | None,
    out: Path | None,
    times_real_time: float | None,
    threads: int | None,
) -> None:
    """Maps a CARMEN log (plain or gzip) through a server, and writes the map and the trajectory.

    Ctrl-C ends the replay and writes what has been mapped until then.
    """
    if server is not None and threads is not None:
        fail("--threads is for a server in this process: give it to `gridwright serve` instead")
    to = console()
    config = _config(config_path, particles)
    name = _log_name(log)
    reading_started_s = time.perf_counter()
    content, events = _read(log)
    reading_s = time.perf_counter() - reading_started_s
    directory = _made_directory(out or Path("out") / name)
    _tell_about(to, name, content)
    options = ReplayOptions(config, seed, times_real_time)
    mapped, interrupted = map_events(to, server, threads, content, events, options)
    replayed = events[: mapped.tally.items]
    if mapped.tally.newest is None:
        fail(f"the server took up none of the log's scans: {dict(mapped.tally.scans) or 'none were sent'}")
    run = ReplayRun(
        name=name,
        log=content,
        mapped=mapped,
        robot_s=robot_seconds(replayed),
        reading_s=reading_s,
        server=server or "in this process",
        interrupted=interrupted,
    )
    try:
        report = write_outputs(run, directory)
    except OSError as error:
        fail(f"cannot write the map: {os_error_text(error)}")
    _tell_outcome(to, report, directory)


def _config(path: Path | None, particles: int | None) -> MapperConfig:
    try:
        config = read_config(path) if path else MapperConfig()
    except OSError as error:
        fail(f"cannot read the configuration {os_error_text(error)}")
    except ConfigError as error:
        fail(str(error))
    if particles is not None:
        config.particles = particles
    return config


def _log_name(log: Path) -> str:
    name = log.name.removesuffix(".gz")
    return name.removesuffix(".clf").removesuffix(".log") or "log"


def _read(path: Path) -> tuple[CarmenLog, list[Event]]:
    try:
        content = read_log(path)
    except OSError as error:
        fail(f"cannot read the log {os_error_text(error)}")
    if not content.scans:
        malformed = "".join(f"; line {line.line_number}: {line.reason}" for line in content.malformed[:1])
        fail(
            f"{path} is not a CARMEN log with laser scans (FLASER, RLASER, ROBOTLASER1, ROBOTLASER2 or "
            f"RAWLASER1 lines){malformed}"
        )
    try:
        return content, events_of(content)
    except NoOdometryError:
        fail(f"{path} has laser scans but no odometry (ODOM lines, or scans with the robot's pose)")


def _made_directory(directory: Path) -> Path:
    try:
        directory.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        fail(f"cannot make the folder for the map {os_error_text(error)}: give another one as --out")
    return directory


def _tell_about(to: Console, name: str, log: CarmenLog) -> None:
    messages = ", ".join(f"{count} {message}" for message, count in sorted(log.messages.items()))
    to.print(f"{name}: {messages}")
    if log.ignored:
        ignored = ", ".join(f"{count} {message}" for message, count in sorted(log.ignored.items()))
        to.print(f"not read: {ignored}")
    if log.malformed:
        first = log.malformed[0]
        to.print(
            f"malformed lines: {len(log.malformed)}, the first is line {first.line_number}: {first.reason}"
        )


def _tell_outcome(to: Console, report: dict[str, Any], directory: Path) -> None:
    scans = ", ".join(f"{count} {verdict.lower()}" for verdict, count in report["scans"].items())
    ended = "Interrupted: mapped" if report["interrupted"] else "Mapped"
    to.print(
        f"{ended} {report['robot_seconds']:.0f} s of driving in {report['wall_seconds']:.1f} s: "
        f"{report['times_real_time']:.0f} x real time, {report['scans_per_second']:.0f} scans/s"
    )
    to.print(f"  scans    {scans}")
    to.print(f"  files    {directory}/ (Nav2 map, trajectories, report.json)")
    to.print(f"  picture  {directory / 'map.png'}")
