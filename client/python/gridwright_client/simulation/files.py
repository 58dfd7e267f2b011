"""A simulated run as files: the log, the true trajectory, and relations."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from gridwright_client.evaluation import Relations
from gridwright_client.se2 import Poses, compose
from gridwright_client.simulation.relations import true_relations
from gridwright_client.simulation.run import LASER_OFFSET_M, Simulation
from gridwright_client.trajectory_file import TimedPoses, stamp_text, write_tum


@dataclass(frozen=True)
class SimulationFiles:
    """Where a run was written."""

    log: Path
    truth: Path
    relations: Path


def write_simulation(simulation: Simulation, log_path: Path) -> SimulationFiles:
    """Writes NAME.clf, and beside it NAME.true.tum (the pose at each scan) and NAME.relations."""
    stem = log_path.with_suffix("") if log_path.suffix == ".clf" else log_path
    files = SimulationFiles(
        log_path,
        stem.with_name(f"{stem.name}.true.tum"),
        stem.with_name(f"{stem.name}.relations"),
    )
    log_path.parent.mkdir(parents=True, exist_ok=True)
    with log_path.open("w", encoding="ascii") as log:
        log.writelines(f"{line}\n" for line in _log_lines(simulation))
    ticks = simulation.scan_ticks
    truth = TimedPoses(simulation.stamps_ns[ticks], simulation.map_from_base[ticks])
    write_tum(files.truth, truth)
    files.relations.write_text("".join(_relation_lines(true_relations(truth))), encoding="ascii")
    return files


def _log_lines(simulation: Simulation) -> Iterator[str]:
    yield "# simulated robot, laser FLASER; formats of the messages:"
    yield "# ODOM x y theta tv rv accel ipc_timestamp ipc_hostname logger_timestamp"
    yield (
        "# FLASER num_readings [range_readings] x y theta odom_x odom_y odom_theta"
        " ipc_timestamp ipc_hostname logger_timestamp"
    )
    yield f"PARAM robot_frontlaser_offset {LASER_OFFSET_M} simulated 0"
    yield f"PARAM robot_front_laser_max {simulation.range_max_m} simulated 0"
    scan_of_tick = {int(tick): scan for scan, tick in enumerate(simulation.scan_ticks)}
    lasers = compose(simulation.odom_from_base, simulation.base_from_laser)
    started_ns = int(simulation.stamps_ns[0])
    for tick, stamp_ns in enumerate(simulation.stamps_ns.tolist()):
        base = _pose_text(simulation.odom_from_base[tick])
        trailer = f"{stamp_text(stamp_ns)} simulated {stamp_text(stamp_ns - started_ns)}"
        scan = scan_of_tick.get(tick)
        if scan is None:
            yield f"ODOM {base} 0 0 0 {trailer}"
            continue
        ranges_m = simulation.ranges_m[scan]
        ranges = " ".join(f"{range_m:.2f}" for range_m in ranges_m.tolist())
        yield f"FLASER {len(ranges_m)} {ranges} {_pose_text(lasers[tick])} {base} {trailer}"


def _relation_lines(relations: Relations) -> Iterator[str]:
    for first_ns, second_ns, (x, y, theta) in zip(
        relations.first_ns.tolist(),
        relations.second_ns.tolist(),
        relations.first_from_second.tolist(),
        strict=True,
    ):
        times = f"{stamp_text(first_ns)} {stamp_text(second_ns)}"
        yield f"{times} {x:.6f} {y:.6f} 0.000000 0.000000 0.000000 {theta:.6f}\n"


def _pose_text(pose: Poses) -> str:
    x, y, theta = pose.tolist()
    return f"{x:.6f} {y:.6f} {theta:.6f}"
