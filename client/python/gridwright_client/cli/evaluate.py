"""`gridwright evaluate`: how good a trajectory is."""

import dataclasses
import json
import math
from pathlib import Path
from typing import Any

import click
from rich.table import Table

from gridwright_client.cli.options import console, fail, os_error_text
from gridwright_client.evaluation import ErrorStatistics, Evaluation, read_relations
from gridwright_client.evaluation import evaluate as score
from gridwright_client.trajectory_file import FileFormatError, read_trajectory

_File = click.Path(path_type=Path)


@click.command()
@click.argument("trajectory", type=_File)
@click.argument("relations", type=_File)
@click.option(
    "--odometry",
    type=_File,
    metavar="FILE",
    help="Raw odometry (`timestamp x y theta` or TUM) for relation times that no pose matches.",
)
@click.option(
    "--max-dt",
    "max_dt_s",
    default=0.0005,
    show_default=True,
    type=click.FloatRange(0.0, 3600.0),
    metavar="SECONDS",
    help="A pose matches a relation's time within this.",
)
@click.option("--json", "as_json", is_flag=True, help="Print JSON instead of a table.")
def evaluate(
    trajectory: Path, relations: Path, odometry: Path | None, max_dt_s: float, as_json: bool
) -> None:
    """Scores TRAJECTORY (TUM) by RELATIONS (`t1 t2 x y z roll pitch yaw`).

    The error of a relation is how far the trajectory's motion from t1 to t2 is from the relation's.
    Standard deviations are of the sample (n - 1).
    """
    try:
        result = score(
            read_trajectory(trajectory),
            read_relations(relations),
            max_dt_s=max_dt_s,
            odometry=read_trajectory(odometry) if odometry else None,
        )
    except OSError as error:
        fail(f"cannot read {os_error_text(error)}")
    except FileFormatError as error:
        fail(str(error))
    if result.matched == 0:
        fail(
            f"no pose of {trajectory} lies within {max_dt_s:g} s of the times of a relation: "
            "give a larger --max-dt, or the log's --odometry"
        )
    if as_json:
        click.echo(json.dumps(as_json_object(result), indent=2))
    else:
        to = console()
        to.print(_table(result))
        to.print(_counts(result))


def as_json_object(result: Evaluation) -> dict[str, Any]:
    """NaN, which JSON does not have, as null."""
    return {
        key: {name: _or_none(number) for name, number in value.items()} if isinstance(value, dict) else value
        for key, value in dataclasses.asdict(result).items()
    }


def _or_none(value: float) -> float | None:
    return None if math.isnan(value) else value


def _table(result: Evaluation) -> Table:
    table = Table()
    table.add_column("error")
    for heading in ("mean", "std. dev.", "largest"):
        table.add_column(heading, justify="right")
    for name, statistics, unit in (
        ("translation", result.translation_m, "m"),
        ("rotation", result.rotation_deg, "deg"),
    ):
        table.add_row(name, *(f"{value:.4f} {unit}" for value in _plain(statistics)))
        table.add_row(f"{name}, squared", *(f"{value:.4f} {unit}²" for value in _squared(statistics)))
    return table


def _plain(statistics: ErrorStatistics) -> tuple[float, float, float]:
    return statistics.mean, statistics.deviation, statistics.largest


def _squared(statistics: ErrorStatistics) -> tuple[float, float, float]:
    return statistics.squared_mean, statistics.squared_deviation, statistics.largest**2


def _counts(result: Evaluation) -> str:
    text = f"{result.matched} relations matched, {result.missed} missed"
    return f"{text}; {result.bridged} bridged by odometry" if result.bridged else text
