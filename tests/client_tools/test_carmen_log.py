"""Every message type, every way a line can be wrong, and files that are damaged."""

import math

import numpy as np
import pytest
from carmen_lines import TRAILER, flaser, odom, rawlaser, robotlaser, write, write_gzip
from gridwright_client.carmen import LaserReading, OdometryReading, TruePoseReading, read_log
from hypothesis import given, settings
from hypothesis import strategies as st

RANGES = [1.0, 2.0, 3.5, 2.5]


@pytest.fixture
def log_path(tmp_path):
    return tmp_path / "made.clf"


def read(path, *lines):
    return read_log(write(path, lines))


def test_odometry(log_path):
    (reading,) = read(log_path, "ODOM 1.5 -2 0.25 0.1 0.2 0.3 " + TRAILER).readings
    assert isinstance(reading, OdometryReading)
    assert reading.line_number == 1
    assert reading.stamp_ns == 1_000_500_000_000
    assert reading.odom_from_base.tolist() == [1.5, -2.0, 0.25]


def test_front_laser(log_path):
    log = read(log_path, flaser(RANGES, base=(1.0, 2.0, 0.5)))
    (reading,) = log.scans
    assert reading.sensor_id == "front"
    assert reading.ranges_m.tolist() == RANGES
    assert reading.odom_from_base.tolist() == [1.0, 2.0, 0.5]
    assert log.messages == {"FLASER": 1}


def test_rear_laser_looks_backward(log_path):
    log = read(log_path, "PARAM robot_rearlaser_offset -0.2 nohost 0", flaser(RANGES, name="RLASER"))
    assert log.scans[0].sensor_id == "rear"
    np.testing.assert_allclose(log.base_from_laser["rear"], (-0.2, 0.0, math.pi))


def test_rear_laser_without_parameters_looks_backward_too(log_path):
    log = read(log_path, flaser(RANGES, name="RLASER"))
    np.testing.assert_allclose(log.base_from_laser["rear"], (0.0, 0.0, math.pi))


def test_robot_laser_tells_geometry_and_mounting(log_path):
    base = (3.0, -1.0, math.pi / 2)
    laser = (3.0, -0.75, math.pi / 2)
    log = read(log_path, robotlaser(RANGES, base, laser, remissions=[7, 8]))
    (reading,) = log.scans
    assert reading.geometry.first_bearing_rad == -1.5
    assert reading.geometry.increment_rad == 0.01
    assert reading.range_max_m == 20.0
    np.testing.assert_allclose(reading.odom_from_base, base)
    np.testing.assert_allclose(log.base_from_laser["front"], (0.25, 0.0, 0.0), atol=1e-6)


def test_second_robot_laser_is_the_rear_one(log_path):
    log = read(log_path, robotlaser(RANGES, laser=(-0.3, 0.0, 3.141593), name="ROBOTLASER2"))
    assert log.scans[0].sensor_id == "rear"
    assert abs(abs(log.base_from_laser["rear"][2]) - math.pi) < 1e-6


def test_raw_laser_carries_no_odometry(log_path):
    log = read(
        log_path, "PARAM robot_frontlaser_offset 0.1 nohost 0", rawlaser(RANGES, remissions=[1, 2, 3, 4])
    )
    (reading,) = log.scans
    assert reading.odom_from_base is None
    assert reading.sensor_id == "front"
    assert log.base_from_laser["front"].tolist() == [0.1, 0.0, 0.0]


def test_true_pose(log_path):
    (reading,) = read(log_path, "TRUEPOS 1 2 0.5 0 0 0 " + TRAILER).readings
    assert isinstance(reading, TruePoseReading)
    assert reading.map_from_base.tolist() == [1.0, 2.0, 0.5]


def test_other_messages_are_counted_by_name(log_path):
    log = read(log_path, "# comment", "", "SYNC x", "GPS 1 2", "SYNC y", odom())
    assert log.ignored == {"SYNC": 2, "GPS": 1}
    assert log.malformed == []
    assert len(log.readings) == 1


def test_the_order_of_the_file_is_kept_where_times_go_back(log_path):
    times = ["10.2", "10.1", "10.3", "9.0"]
    log = read(log_path, *(odom(seconds=time) for time in times))
    assert [reading.stamp_ns for reading in log.readings] == [
        10_200_000_000,
        10_100_000_000,
        10_300_000_000,
        9_000_000_000,
    ]


@pytest.mark.parametrize(
    ("line", "reason"),
    [
        ("ODOM 1 2", "too few fields"),
        (odom() + " 7", "too many fields"),
        ("ODOM 1 2 x 0 0 0 " + TRAILER, "'x' is not a number"),
        ("ODOM 1 2 1_0 0 0 0 " + TRAILER, "'1_0' is not a number"),
        ("ODOM 1 2 nan 0 0 0 " + TRAILER, "the odometry pose is not finite"),
        ("ODOM 1 2 0 0 0 0 never robot 0.5", "the time 'never' is not a number"),
        ("ODOM 1 2 0 0 0 0 -1 robot 0.5", "not between the years 1970 and 9999"),
        ("ODOM 1 2 0 0 0 0 1e300 robot 0.5", "out of range"),
        ("FLASER", "too few fields"),
        ("FLASER x", "too few fields"),
        ("FLASER 180 1 2 3 0 0 0 0 0 0 " + TRAILER, "180 ranges announced"),
        ("FLASER -3 1 2 3 0 0 0 0 0 0 " + TRAILER, "number of ranges is '-3'"),
        ("FLASER 2 1 2 3 0 0 0 0 0 0 " + TRAILER, "too many fields"),
        (flaser([1.0, "one"]), "'one' is not a number"),
        (flaser([1.0], base=(0.0, "inf", 0.0)), "pose is not finite"),
        (robotlaser([1.0]).replace("ROBOTLASER1 0 -1.5", "ROBOTLASER1 0 nan"), "start angle is 'nan'"),
        (rawlaser([1.0]) + " 3", "too many fields"),
        ("PARAM", "too few fields"),
        ("12 3", "does not begin with a message's name"),
    ],
)
def test_a_malformed_line_is_skipped_and_named(log_path, line, reason):
    log = read(log_path, odom(), line, odom())
    assert [entry.line_number for entry in log.malformed] == [2]
    assert reason in log.malformed[0].reason
    assert len(log.readings) == 2


def test_undecodable_bytes_are_a_malformed_line(log_path):
    log_path.write_bytes(odom().encode() + b"\nODOM 1 \xff 3\n\xfe\xed\n" + odom().encode())
    log = read_log(log_path)
    assert [entry.line_number for entry in log.malformed] == [2, 3]
    assert "not text" in log.malformed[0].reason
    assert len(log.readings) == 2


def test_gzip_reads_as_plain_text_does(tmp_path):
    lines = [odom(x=index) for index in range(100)] + [flaser(RANGES)]
    plain = read_log(write(tmp_path / "plain.clf", lines))
    packed = read_log(write_gzip(tmp_path / "packed.clf.gz", lines))
    assert packed.messages == plain.messages
    assert packed.malformed == []
    assert packed.scans[0].ranges_m.tolist() == plain.scans[0].ranges_m.tolist()


def test_two_gzip_members_are_one_log(tmp_path):
    first = write_gzip(tmp_path / "first.gz", [odom(x=1)]).read_bytes()
    second = write_gzip(tmp_path / "second.gz", [odom(x=2)]).read_bytes()
    (tmp_path / "both.gz").write_bytes(first + second)
    assert len(read_log(tmp_path / "both.gz").readings) == 2


def test_a_gzip_file_that_ends_too_early_gives_what_it_has(tmp_path):
    rng = np.random.default_rng(1)
    lines = [flaser(np.round(rng.uniform(1, 9, 180), 2).tolist()) for _ in range(300)]
    whole = write_gzip(tmp_path / "whole.clf.gz", lines).read_bytes()
    (tmp_path / "cut.clf.gz").write_bytes(whole[: len(whole) // 2])
    log = read_log(tmp_path / "cut.clf.gz")
    assert 100 < len(log.scans) < 200
    assert "ends too early" in log.malformed[-1].reason


def test_damaged_gzip_data_give_what_comes_before(tmp_path):
    rng = np.random.default_rng(2)
    lines = [flaser(np.round(rng.uniform(1, 9, 180), 2).tolist()) for _ in range(2000)]
    data = bytearray(write_gzip(tmp_path / "whole.clf.gz", lines).read_bytes())
    middle = len(data) // 2
    data[middle : middle + 64] = b"\xff" * 64
    (tmp_path / "bad.clf.gz").write_bytes(data)
    log = read_log(tmp_path / "bad.clf.gz")
    assert len(log.scans) > 500
    assert log.malformed


@given(st.integers(0, 253_402_300_799), st.integers(0, 999_999_999), st.integers(0, 9))
def test_times_are_exact_to_the_nanosecond(tmp_path_factory, seconds, nanos, digits):
    text = f"{seconds}.{nanos:09d}"[: len(str(seconds)) + 1 + digits]
    path = tmp_path_factory.getbasetemp() / "time.clf"
    (reading,) = read(path, odom(seconds=text)).readings
    kept = int(f"{nanos:09d}"[:digits].ljust(9, "0"))
    assert reading.stamp_ns == seconds * 1_000_000_000 + kept


def test_exponents_in_times_are_understood(log_path):
    (reading,) = read(log_path, odom(seconds="1.5e+3")).readings
    assert reading.stamp_ns == 1_500_000_000_000


@settings(max_examples=300)
@given(
    st.lists(
        st.one_of(
            st.binary(max_size=60),
            st.sampled_from(
                [b"ODOM ", b"FLASER 2 ", b"ROBOTLASER1 ", b"PARAM a", b"RAWLASER1 0 1 1 1"]
            ).flatmap(
                lambda head: st.text("0123456789.- enaif", max_size=60).map(lambda tail: head + tail.encode())
            ),
        ),
        max_size=8,
    )
)
def test_no_bytes_are_fatal(tmp_path_factory, lines):
    path = tmp_path_factory.getbasetemp() / "garbage.clf"
    path.write_bytes(b"\n".join([odom().encode(), *lines, odom().encode()]))
    log = read_log(path)
    assert len(log.readings) >= 2
    for scan in log.scans:
        assert isinstance(scan, LaserReading)
        assert len(scan.ranges_m) == scan.geometry.beams


@pytest.mark.real_log
def test_the_intel_log_is_read_entirely(recorded_logs):
    log = read_log(recorded_logs / "intel" / "intel.clf")
    assert log.messages == {"PARAM": 2, "ODOM": 9149, "FLASER": 4482}
    assert log.malformed == []
    assert log.scans[0].stamp_ns == 976_052_857_348_849_000
