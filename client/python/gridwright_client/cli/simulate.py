"""`gridwright simulate`: a log to try the server with, and the truth to judge its map by."""

from pathlib import Path

import click

from gridwright_client.cli.options import console, fail, os_error_text
from gridwright_client.simulation import SimulationOptions, run_simulation, write_simulation


@click.command()
@click.argument("out", type=click.Path(dir_okay=False, path_type=Path), metavar="OUT.clf")
@click.option("--seed", default=0, show_default=True, type=click.IntRange(min=0), help="Of all noise.")
@click.option(
    "--laps",
    default=2,
    show_default=True,
    type=click.IntRange(1, 50),
    help="Times around the loop; the first goes through rooms.",
)
@click.option(
    "--duration",
    "duration_s",
    type=click.FloatRange(1.0, 86_400.0),
    metavar="SECONDS",
    help="Stop after this much robot time, wherever the robot is.",
)
@click.option(
    "--beams",
    default="180",
    show_default=True,
    type=click.Choice(["180", "181", "360", "361"]),
    help="Of a sweep.",
)
def simulate(out: Path, seed: int, laps: int, duration_s: float | None, beams: str) -> None:
    """Drives a robot with drifting odometry and a noisy laser through an office floor.

    Writes the CARMEN log OUT.clf, and beside it OUT.true.tum (the true pose at each scan) and
    OUT.relations (true relative poses, for `gridwright evaluate`). The same options give the same
    files.
    """
    options = SimulationOptions(seed=seed, laps=laps, duration_s=duration_s, beams=int(beams))
    simulation = run_simulation(options)
    try:
        files = write_simulation(simulation, out)
    except OSError as error:
        fail(f"cannot write the log: {os_error_text(error)}")
    robot_s = (simulation.stamps_ns[-1] - simulation.stamps_ns[0]) * 1e-9
    to = console()
    to.print(
        f"Simulated {robot_s:.0f} s of driving: {simulation.path_m:.0f} m, "
        f"{len(simulation.scan_ticks)} scans of {options.beams} beams"
    )
    to.print(f"  log        {files.log}")
    to.print(f"  truth      {files.truth}")
    to.print(f"  relations  {files.relations}")
