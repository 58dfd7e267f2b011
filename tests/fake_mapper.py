"""A stand-in for the mapper: instant, and its results depend on the order of all it was given."""

import threading

import numpy as np
from gridwright_server.slam.types import PoseEstimate, ScanResult, Trajectory, Verdict

SECRET = "the path /etc/secret"
BAD_STAMP_NS = 666


class FakeSnapshot:
    def __init__(self, tiles, revision, tile_cells=64):
        self.stamp_ns = 7
        self.revision = revision
        self.generation = 1
        self.resolution_m = 0.05
        self.tile_cells = tile_cells
        side = int(np.ceil(np.sqrt(tiles)))
        places = [(k % side - 2, k // side - 1) for k in range(tiles)]
        self.tile_origins = np.array(places, dtype=np.int32).reshape(-1, 2) * np.int32(tile_cells)
        self.closed = threading.Event()

    def occupancy(self, tile):
        return np.full((self.tile_cells, self.tile_cells), tile % 101, dtype=np.int8)

    def close(self):
        self.closed.set()


class FakeMapper:
    """`hold` makes it wait within the next scan until `release`; `entered` tells that it got there."""

    def __init__(self, config=None, seed=0, workers=None, worker_count=1, tiles=3):
        self.seed = seed
        self.tiles = tiles
        self.scans = []
        self.stamps = []
        self.odometry = None
        self.snapshots = []
        self.state = float(seed)
        self.free = threading.Event()
        self.free.set()
        self.entered = threading.Event()

    def hold(self):
        self.free.clear()

    def release(self):
        self.free.set()

    def add_odometry(self, stamp_ns, odom_from_base):
        self.odometry = odom_from_base
        self.state = 0.9 * self.state + float(odom_from_base.sum())
        return Verdict.PROCESSED

    def add_scan(self, scan):
        self.entered.set()
        self.free.wait()
        if scan.stamp_ns == BAD_STAMP_NS:
            raise RuntimeError(SECRET)
        if self.odometry is None:
            return ScanResult(Verdict.REJECTED_NO_ODOMETRY)
        self.scans.append(scan)
        self.state = 0.5 * self.state + float(np.nansum(scan.ranges_m[np.isfinite(scan.ranges_m)]))
        estimate = PoseEstimate(
            stamp_ns=scan.stamp_ns,
            map_from_base=np.array([self.state, self.odometry[1], self.odometry[2]]),
            covariance=np.eye(3) * 0.01,
            map_from_odom=np.zeros(3),
            effective_sample_size=1.5,
            particle_count=2,
        )
        skipped = len(self.scans) % 3 == 0
        verdict = Verdict.SKIPPED_BELOW_MOTION_THRESHOLD if skipped else Verdict.PROCESSED
        return ScanResult(verdict, estimate)

    def trajectory(self):
        n = len(self.scans)
        return Trajectory(
            stamps_ns=np.array([scan.stamp_ns for scan in self.scans], dtype=np.int64),
            map_from_base=np.arange(3 * n, dtype=np.float64).reshape(n, 3) / max(3 * n, 1),
            processed=np.arange(n) % 3 != 2,
        )

    def map_snapshot(self):
        if not self.scans:
            return None
        self.snapshots.append(FakeSnapshot(self.tiles, len(self.scans)))
        return self.snapshots[-1]
