"""After the warm-up nothing is left to compile: the first scan of a session takes no longer than others."""

import subprocess
import sys

MAP_AND_COUNT = """
import sys
from concurrent.futures import ThreadPoolExecutor
import numpy as np
from numba.core.dispatcher import Dispatcher
from gridwright_server.config import MapperConfig
from gridwright_server.slam import mapper
from gridwright_server.slam.types import Scan

def compiled():
    kernels = {
        id(value): value
        for name, module in sys.modules.items() if name.startswith("gridwright_server")
        for value in vars(module).values() if isinstance(value, Dispatcher)
    }
    return {kernel.py_func.__qualname__: list(kernel.signatures) for kernel in kernels.values()}

mapper.warm_up()
before = compiled()
rng = np.random.default_rng(0)
with ThreadPoolExecutor(2) as workers:
    session = mapper.Mapper(MapperConfig(particles=5), 1, workers, 2)
    for k in range(1, 30):
        session.add_odometry(100 * k, np.array((0.11 * k, 0.3 * k, 0.05 * k)))
        ranges = rng.uniform(0.5, 9.0, 181)
        bearings, mounting = np.linspace(-1.57, 1.57, 181), np.array((0.1, 0.0, 3.1))
        session.add_scan(Scan(100 * k - 30, bearings, ranges, 0.1, 8.0, mounting))
    session.trajectory()
    snapshot = session.map_snapshot()
    snapshot.occupancy(0)
    snapshot.close()
    session.add_odometry(3000, np.zeros(3))
    session.add_scan(Scan(3000, bearings, ranges, 0.1, 8.0, np.zeros(3)))
after = compiled()
late = {name: after[name] for name in after if after[name] != before[name]}
assert not late, late
"""


def test_nothing_is_compiled_after_the_warm_up():
    # In a process of its own, for the other tests compile kernels too.
    subprocess.run([sys.executable, "-c", MAP_AND_COUNT], check=True, timeout=250)
