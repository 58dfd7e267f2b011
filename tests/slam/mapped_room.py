"""A mapper in a small simulated room: how tests drive it and what they read of it."""

import numpy as np
from gridwright_server.config import (
    MapperConfig,
    SensorConfig,
)
from gridwright_server.slam import se2
from gridwright_server.slam.mapper import Mapper
from gridwright_server.slam.types import Scan, Verdict
from simulated_room import (
    FRONT,
    HALF_CIRCLE,
    SECOND_NS,
    drifting,
    drive,
    scan_at,
)

CONFIG = MapperConfig(particles=6)
STEPS = 30
BLURRED = SensorConfig(hit_sigma_meters=3.0)


def feed(mapper, poses, odometry, first=0, **how):
    """Drives along; returns each scan's result. Scan k is taken at second k."""
    rng = np.random.default_rng(7)
    results = []
    for k, (pose, reading) in enumerate(zip(poses, odometry, strict=True), start=first):
        assert mapper.add_odometry(k * SECOND_NS, reading) is Verdict.PROCESSED
        results.append(mapper.add_scan(scan_at(k * SECOND_NS, pose, rng, **how)))
    return results


def occupancy(mapper):
    """{(row, column) of a tile's first cell: its cells} of the map as known now."""
    snapshot = mapper.map_snapshot()
    tiles = {tuple(origin): snapshot.occupancy(k) for k, origin in enumerate(snapshot.tile_origins.tolist())}
    snapshot.close()
    return tiles


def fingerprint(mapper):
    trajectory, snapshot = mapper.trajectory(), mapper.map_snapshot()
    parts = [trajectory.map_from_base.tobytes(), trajectory.stamps_ns.tobytes()]
    parts += [snapshot.tile_origins.tobytes(), mapper.estimate().covariance.tobytes()]
    parts += [snapshot.occupancy(k).tobytes() for k in range(len(snapshot.tile_origins))]
    snapshot.close()
    return b"".join(parts)


def errors(poses, results):
    away = np.array(
        [
            se2.between(pose, result.estimate.map_from_base)
            for pose, result in zip(poses, results, strict=True)
        ]
    )
    return np.hypot(away[:, 0], away[:, 1]), np.abs(away[:, 2])


def nothing_seen(stamp_ns, range_m=np.inf):
    return Scan(stamp_ns, HALF_CIRCLE, np.full(len(HALF_CIRCLE), range_m), 0.05, 20.0, FRONT)


def run(workers, seed=5, threads=1, config=CONFIG, steps=STEPS, **how):
    """Everything that comes out of one drive, as bytes."""
    mapper = Mapper(config, seed, workers, threads)
    poses = drive(steps)
    results = feed(mapper, poses, drifting(poses), **how)
    return fingerprint(mapper), [result.estimate.map_from_base.tobytes() for result in results]
