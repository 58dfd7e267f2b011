"""The mapper: sensor items in their order of arrival go in, poses and the map come out."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from gridwright_server.config import MapperConfig, ResamplingConfig
from gridwright_server.errors import ResourceExhaustedError
from gridwright_server.slam import se2
from gridwright_server.slam.beams import Beams, beams_of
from gridwright_server.slam.filter import ParticleFilter
from gridwright_server.slam.motion import drift_of, is_update_due
from gridwright_server.slam.odometry import OdometryBuffer
from gridwright_server.slam.scans import ScanRecord
from gridwright_server.slam.snapshot import TileSnapshot
from gridwright_server.slam.types import Pose, PoseEstimate, Scan, ScanResult, Trajectory, Verdict, Workers

REVERSAL_TOLERANCE_NS = 2_000_000_000
"""How far a time stamp may lie behind the newest one before its item is refused.

Real logs step back by milliseconds where readings come in bursts, by a second where two computers'
clocks disagree; the order of arrival is the order of events.
"""


class Mapper:
    """The multilevel Rao-Blackwellized particle filter of one session; used by one thread at a time."""

    def __init__(self, config: MapperConfig, seed: int, workers: Workers, worker_count: int) -> None:
        self._config = config
        self._filter = ParticleFilter(config, seed, workers, worker_count)
        self._odometry = OdometryBuffer()
        self._scans = ScanRecord()
        self._newest_ns: int | None = None
        self._odom_at_update: Pose = np.zeros(3)
        self._odom_at_last_update_of: dict[bytes, Pose] = {}
        """By the laser's mounting: each laser has a motion filter of its own, for each sees other things."""
        self._update_ns = 0
        self._estimate: PoseEstimate | None = None

    def add_odometry(self, stamp_ns: int, odom_from_base: Pose) -> Verdict:
        """Takes up one odometry reading: PROCESSED or REJECTED_OUT_OF_ORDER."""
        if self._is_too_old(stamp_ns):
            return Verdict.REJECTED_OUT_OF_ORDER
        self._odometry.add(stamp_ns, odom_from_base)
        return Verdict.PROCESSED

    def add_scan(self, scan: Scan) -> ScanResult:
        """Takes up one scan."""
        if self._is_too_old(scan.stamp_ns):
            return ScanResult(Verdict.REJECTED_OUT_OF_ORDER)
        if not self._odometry:
            return ScanResult(Verdict.REJECTED_NO_ODOMETRY)
        odom_from_base = self._odometry.at(scan.stamp_ns)
        beams = beams_of(scan, self._config.sensor.usable_range_meters)
        try:
            due = self._is_update_due(scan, odom_from_base, beams)
            if due:
                self._update(scan, odom_from_base, beams)
        except ResourceExhaustedError:
            return ScanResult(Verdict.REJECTED_OUTSIDE_MAP)
        self._scans.append(scan.stamp_ns, odom_from_base, self._filter.updates - 1, due)
        self._estimate = self._estimate_at(scan.stamp_ns, odom_from_base)
        verdict = Verdict.PROCESSED if due else Verdict.SKIPPED_BELOW_MOTION_THRESHOLD
        return ScanResult(verdict, self._estimate)

    def estimate(self) -> PoseEstimate | None:
        """The pose at the newest scan; None before the first one."""
        return self._estimate

    def trajectory(self) -> Trajectory:
        """The best particle's path as known now."""
        return self._scans.along_path(self._filter.best_path())

    def map_snapshot(self) -> TileSnapshot | None:
        """The best particle's map as known now; None before the first scan."""
        best = self._filter
        if best.updates == 0:
            return None
        return TileSnapshot(
            best.pool,
            best.pages,
            best.best,
            best.grid.resolution_m,
            self._update_ns,
            best.updates,
            best.generation,
        )

    def _is_too_old(self, stamp_ns: int) -> bool:
        if self._newest_ns is not None and stamp_ns < self._newest_ns - REVERSAL_TOLERANCE_NS:
            return True
        self._newest_ns = stamp_ns if self._newest_ns is None else max(self._newest_ns, stamp_ns)
        return False

    def _is_update_due(self, scan: Scan, odom_from_base: Pose, beams: Beams) -> bool:
        """Has the robot moved since this laser's last update, by odometry or (wheels slip) by the scan?"""
        odom_at_last = self._odom_at_last_update_of.get(scan.base_from_laser.tobytes())
        if odom_at_last is None:
            return True
        if is_update_due(self._config.motion, se2.between(odom_at_last, odom_from_base)):
            return True
        if not len(beams.points):  # nothing in sight: no sign that the robot moved
            return False
        return self._filter.fit_of(self._moved_to(odom_from_base), beams) < self._config.motion.update_score

    def _update(self, scan: Scan, odom_from_base: Pose, beams: Beams) -> None:
        if self._filter.updates == 0:
            # The frame map starts as odom does: until a match corrects it, map -> odom is the identity.
            self._filter.start(odom_from_base, beams)
        else:
            self._filter.update(self._moved_to(odom_from_base), beams)
        self._odom_at_update = odom_from_base
        self._odom_at_last_update_of[scan.base_from_laser.tobytes()] = odom_from_base
        self._update_ns = scan.stamp_ns

    def _moved_to(self, odom_from_base: Pose) -> Pose:
        """Odometry since the last update."""
        return se2.between(self._odom_at_update, odom_from_base)

    def _estimate_at(self, stamp_ns: int, odom_from_base: Pose) -> PoseEstimate:
        """The best particle's pose, carried on by the odometry since the last update."""
        particles = self._filter
        moved = self._moved_to(odom_from_base)
        map_from_base = se2.compose(particles.poses[particles.best], moved)
        covariance = particles.covariance + drift_of(self._config.motion, moved).covariance()
        return PoseEstimate(
            stamp_ns,
            map_from_base,
            covariance,
            se2.compose(map_from_base, se2.inverse(odom_from_base)),
            particles.effective_sample_size,
            self._config.particles,
        )


def warm_up() -> None:
    """Compiles (or loads from the cache) every kernel, by mapping a made-up room."""
    scan = Scan(0, np.linspace(-1.5, 1.5, 31), np.full(31, 2.0), 0.1, 10.0, np.zeros(3))
    mapper = Mapper(
        MapperConfig(particles=2, resampling=ResamplingConfig(threshold_ratio=1.0)), 0, _Inline(), 1
    )
    mapper.add_odometry(0, np.zeros(3))
    for k in range(1, 5):
        mapper.add_odometry(2 * k, np.array((0.15 * k, 0.0, 0.1)))
        mapper.add_scan(replace(scan, stamp_ns=2 * k - 1))
    mapper.trajectory()
    snapshot = mapper.map_snapshot()
    assert snapshot is not None
    snapshot.close()
    mapper.add_odometry(10, np.array((1.0, 0.0, 0.1)))
    mapper.add_scan(replace(scan, stamp_ns=10))


class _Inline:
    """Workers that are the caller itself."""

    def map(self, fn: Callable[..., Any], *iterables: Iterable[Any]) -> Iterator[Any]:
        return map(fn, *iterables)
