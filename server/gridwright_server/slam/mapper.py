"""Algorithm 1."""

from gridwright_server.config import MapperConfig
from gridwright_server.slam.types import MapSnapshot, Pose, PoseEstimate, Scan, ScanResult, Trajectory, Verdict, Workers


class Mapper:
    """The multilevel Rao-Blackwellized particle filter of one session; used by one thread at a time."""

    def __init__(self, config: MapperConfig, seed: int, workers: Workers, worker_count: int) -> None:
        raise NotImplementedError

    def add_odometry(self, stamp_ns: int, odom_from_base: Pose) -> Verdict:
        """Takes up one odometry reading: PROCESSED or REJECTED_OUT_OF_ORDER."""
        raise NotImplementedError

    def add_scan(self, scan: Scan) -> ScanResult:
        """Takes up one scan."""
        raise NotImplementedError

    def estimate(self) -> PoseEstimate | None:
        """The newest pose; None before the first scan."""
        raise NotImplementedError

    def trajectory(self) -> Trajectory:
        """The best particle's path as known now."""
        raise NotImplementedError

    def map_snapshot(self) -> MapSnapshot | None:
        """The best particle's map as known now; None before the first scan."""
        raise NotImplementedError


def warm_up() -> None:
    """Compiles (or loads from the cache) every kernel, by mapping a small made-up room."""
    raise NotImplementedError
