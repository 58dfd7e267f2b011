"""What the client sends: times and batches."""

import numpy as np
import pytest
from gridwright_client.items import batches, laser_scan, nanoseconds, odometry, sensor_item, timestamp


@pytest.mark.parametrize("stamp_ns", [0, 1, -1, 10**9, 10**9 - 1, 1_700_000_000_123_456_789, -(10**18) - 7])
def test_times_are_exact(stamp_ns):
    stamp = timestamp(stamp_ns)
    assert 0 <= stamp.nanos < 10**9
    assert nanoseconds(stamp) == stamp_ns


def items(count):
    return [sensor_item(number, odometry(number, 0.0, 0.0, 0.0)) for number in range(1, count + 1)]


@pytest.mark.parametrize(("count", "sizes"), [(0, []), (1, [1]), (64, [64]), (65, [64, 1]), (128, [64, 64])])
def test_batches_by_number(count, sizes):
    packed = list(batches(items(count), 64))
    assert [len(batch.items) for batch in packed] == sizes
    assert [item for batch in packed for item in batch.items] == items(count)


def test_batches_of_large_scans_stay_below_what_the_server_takes():
    ranges = np.ones(65_536, dtype=np.float32)
    scan = laser_scan(0, ranges, angle_min_rad=0, angle_increment_rad=1e-4, range_min_m=0, range_max_m=9)
    packed = list(batches((sensor_item(number, scan) for number in range(1, 20)), 64))
    assert sum(len(batch.items) for batch in packed) == 19
    assert max(batch.ByteSize() for batch in packed) < 2 << 20


def test_a_batch_is_sent_as_soon_as_it_is_full():
    drawn = []

    def source():
        for item in items(10):
            drawn.append(item)
            yield item

    packed = batches(source(), 3)
    next(packed)
    assert len(drawn) == 3
