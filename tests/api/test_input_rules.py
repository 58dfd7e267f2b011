"""Every rule about input: which call breaks it, and which field the answer names."""

import math

import grpc
import pytest
from google.protobuf.timestamp_pb2 import Timestamp
from gridwright.v1 import mapping_service_pb2 as mapping
from gridwright.v1 import session_service_pb2 as pb
from gridwright.v1.geometry_pb2 import Pose2D
from gridwright.v1.sensor_pb2 import (
    VERDICT_PROCESSED,
    VERDICT_REJECTED_INVALID,
    LaserMounting,
    LaserScan,
    Odometry,
)
from gridwright_client.errors import GridwrightRpcError
from gridwright_client.items import odometry, sensor_item
from support import SECOND_NS, scan_message

NAN, INF = math.nan, math.inf


def changed(message, **fields):
    copy = type(message)()
    copy.CopyFrom(message)
    for name, value in fields.items():
        if value is None:
            copy.ClearField(name)
        elif isinstance(value, list):
            copy.ClearField(name)
            getattr(copy, name).extend(value)
        elif hasattr(value, "DESCRIPTOR"):
            getattr(copy, name).CopyFrom(value)
        else:
            setattr(copy, name, value)
    return copy


BAD_SCANS = [
    ("scan.stamp", {"stamp": None}),
    ("scan.stamp.nanos", {"stamp": Timestamp(nanos=-1)}),
    ("scan.stamp.nanos", {"stamp": Timestamp(nanos=10**9)}),
    ("scan.stamp.seconds", {"stamp": Timestamp(seconds=2**62)}),
    ("scan.stamp.seconds", {"stamp": Timestamp(seconds=-(2**63))}),
    ("scan.sensor_id", {"sensor_id": "other"}),
    ("scan.ranges_meters", {"ranges_meters": []}),
    ("scan.ranges_meters", {"ranges_meters": [1.0] * 65_537}),
    ("scan.angle_min_radians", {"angle_min_radians": NAN}),
    ("scan.angle_min_radians", {"angle_min_radians": INF}),
    ("scan.angle_min_radians", {"angle_min_radians": -90.0}),
    ("scan.angle_increment_radians", {"angle_increment_radians": 0.0}),
    ("scan.angle_increment_radians", {"angle_increment_radians": NAN}),
    ("scan.angle_increment_radians", {"angle_increment_radians": INF}),
    ("scan.angle_increment_radians", {"angle_increment_radians": 1e300}),
    ("scan.range_min_meters", {"range_min_meters": NAN}),
    ("scan.range_min_meters", {"range_min_meters": -0.1}),
    ("scan.range_max_meters", {"range_max_meters": INF}),
    ("scan.range_max_meters", {"range_max_meters": NAN}),
    ("scan.range_max_meters", {"range_min_meters": 5.0, "range_max_meters": 5.0}),
    ("scan.range_max_meters", {"range_min_meters": 6.0, "range_max_meters": 5.0}),
]
BAD_ODOMETRY = [
    ("odometry.stamp", {"stamp": None}),
    ("odometry.stamp.nanos", {"stamp": Timestamp(nanos=2 * 10**9)}),
    ("odometry.pose", {"pose": None}),
    ("odometry.pose.x_meters", {"pose": Pose2D(x_meters=NAN)}),
    ("odometry.pose.x_meters", {"pose": Pose2D(x_meters=-1.1e6)}),
    ("odometry.pose.y_meters", {"pose": Pose2D(y_meters=INF)}),
    ("odometry.pose.y_meters", {"pose": Pose2D(y_meters=1.1e6)}),
    ("odometry.pose.theta_radians", {"pose": Pose2D(theta_radians=NAN)}),
    ("odometry.pose.theta_radians", {"pose": Pose2D(theta_radians=-INF)}),
]


def refused(call, *arguments, code=grpc.StatusCode.INVALID_ARGUMENT, **options):
    with pytest.raises(grpc.RpcError) as caught:
        call(*arguments, timeout=20.0, **options)
    error = GridwrightRpcError(caught.value)
    assert error.code is code, error
    return error


@pytest.fixture
def session(fake_server):
    return fake_server.client.create_session("robot").session_id


@pytest.mark.parametrize(("field", "change"), BAD_SCANS)
def test_unary_scan(fake_server, session, field, change):
    request = mapping.AddLaserScanRequest(session_id=session, scan=changed(scan_message(), **change))
    error = refused(fake_server.mapping.AddLaserScan, request)
    assert error.reason == "INVALID_FIELDS"
    assert list(error.violations) == [field]


@pytest.mark.parametrize(("field", "change"), BAD_ODOMETRY)
def test_unary_odometry(fake_server, session, field, change):
    reading = changed(odometry(SECOND_NS, 0.0, 0.0, 0.0), **change)
    request = mapping.AddOdometryRequest(session_id=session, odometry=reading)
    error = refused(fake_server.mapping.AddOdometry, request)
    assert list(error.violations) == [field]


def test_every_bad_item_of_a_stream_is_answered_and_none_ends_it(fake_server, session):
    bad = [(field, changed(scan_message(), **change)) for field, change in BAD_SCANS]
    bad += [(field, changed(odometry(1, 0.0, 0.0, 0.0), **change)) for field, change in BAD_ODOMETRY]
    items = [sensor_item(number, data) for number, (_, data) in enumerate(bad, start=1)]
    items.append(mapping.SensorItem(sequence_number=len(items) + 1))
    items.append(sensor_item(0, odometry(1, 0.0, 0.0, 0.0)))
    items.append(sensor_item(len(items), odometry(1, 0.0, 0.0, 0.0)))
    verdicts = list(fake_server.client.stream(session, items, batch_size=7))

    assert [[violation.field for violation in verdict.violations] for verdict in verdicts] == [
        *([field] for field, _ in bad),
        ["data"],
        ["sequence_number"],
        [],
    ]
    assert [verdict.verdict for verdict in verdicts] == [VERDICT_REJECTED_INVALID] * (len(bad) + 2) + [
        VERDICT_PROCESSED
    ]
    assert fake_server.client.get_session(session).counts.rejected_invalid == len(bad) + 2


def test_all_wrong_fields_are_named_at_once(fake_server, session):
    scan = LaserScan(angle_min_radians=NAN, ranges_meters=[])
    error = refused(
        fake_server.mapping.AddLaserScan, mapping.AddLaserScanRequest(session_id=session, scan=scan)
    )
    assert set(error.violations) == {
        "scan.stamp",
        "scan.ranges_meters",
        "scan.angle_min_radians",
        "scan.angle_increment_radians",
        "scan.range_max_meters",
    }


def test_unset_messages(fake_server, session):
    error = refused(fake_server.mapping.AddLaserScan, mapping.AddLaserScanRequest(session_id=session))
    assert list(error.violations) == ["scan"]
    error = refused(fake_server.mapping.AddOdometry, mapping.AddOdometryRequest(session_id=session))
    assert list(error.violations) == ["odometry"]


def test_nan_inf_and_out_of_range_ranges_are_legal(fake_server, session):
    fake_server.client.add_odometry(session, 0, 0.0, 0.0, 0.0)
    scan = scan_message(ranges_m=[NAN, INF, -INF, -1.0, 1e30, 2.0])
    response = fake_server.mapping.AddLaserScan(
        mapping.AddLaserScanRequest(session_id=session, scan=scan), timeout=20.0
    )
    assert response.verdict == VERDICT_PROCESSED
    [received] = fake_server.mappers[0].scans
    assert len(received.ranges_m) == 6
    assert math.isnan(received.ranges_m[0])
    assert received.bearings_rad.tolist() == [-1.0, -0.5, 0.0, 0.5, 1.0, 1.5]


def test_limits_are_inclusive(fake_server, session):
    fake_server.client.add_odometry(session, 0, 1e6, -1e6, 1e9)
    assert abs(fake_server.mappers[0].odometry[2]) <= math.pi
    scan = scan_message(ranges_m=[1.0] * 65_536, angle_increment_rad=-1e-5)
    request = mapping.AddLaserScanRequest(session_id=session, scan=scan)
    assert fake_server.mapping.AddLaserScan(request, timeout=20.0).verdict == VERDICT_PROCESSED


@pytest.mark.parametrize("session_id", ["", "A", "a b", "a/../b", "ä", "x" * 64, "a\n"])
def test_bad_session_ids(fake_server, session_id):
    stubs = [
        (fake_server.sessions.GetSession, pb.GetSessionRequest),
        (fake_server.sessions.FinishSession, pb.FinishSessionRequest),
        (fake_server.sessions.DeleteSession, pb.DeleteSessionRequest),
        (fake_server.mapping.AddLaserScan, mapping.AddLaserScanRequest),
        (fake_server.mapping.AddOdometry, mapping.AddOdometryRequest),
        (fake_server.mapping.GetPose, mapping.GetPoseRequest),
    ]
    for call, request in stubs:
        assert list(refused(call, request(session_id=session_id)).violations) == ["session_id"]
    for call, request in [
        (fake_server.mapping.GetMap, mapping.GetMapRequest),
        (fake_server.mapping.GetTrajectory, mapping.GetTrajectoryRequest),
    ]:
        error = refused(lambda *a, call=call, **o: list(call(*a, **o)), request(session_id=session_id))
        assert list(error.violations) == ["session_id"]
    if session_id:
        error = refused(fake_server.sessions.CreateSession, pb.CreateSessionRequest(session_id=session_id))
        assert list(error.violations) == ["session_id"]


@pytest.mark.parametrize(
    ("request_", "fields"),
    [
        (pb.CreateSessionRequest(lasers=[LaserMounting(sensor_id="a"), LaserMounting(sensor_id="a")]),
         ["lasers[1].sensor_id"]),
        (pb.CreateSessionRequest(lasers=[LaserMounting()]), ["lasers[0].sensor_id"]),
        (pb.CreateSessionRequest(lasers=[LaserMounting(sensor_id="a", pose=Pose2D(theta_radians=NAN))]),
         ["lasers[0].pose.theta_radians"]),
        (pb.CreateSessionRequest(config=pb.MapperConfig(particles=0)), ["config.particles"]),
        (pb.CreateSessionRequest(config=pb.MapperConfig(grid=pb.GridConfig(resolution_meters=NAN))),
         ["config.grid.resolution_meters"]),
        (pb.CreateSessionRequest(session_id="X", config=pb.MapperConfig(particles=10**6)),
         ["session_id", "config.particles"]),
    ],
)  # fmt: skip
def test_bad_sessions(fake_server, request_, fields):
    assert list(refused(fake_server.sessions.CreateSession, request_).violations) == fields


def test_a_configuration_wrong_in_every_field_fits_the_trailers(fake_server):
    config = pb.MapperConfig(particles=4_000_000_000)
    wrong = 1
    for stage in config.DESCRIPTOR.fields:
        if stage.message_type is not None:
            for field in stage.message_type.fields:
                value = 4_000_000_000 if field.cpp_type == field.CPPTYPE_UINT32 else -1.2345678e300
                setattr(getattr(config, stage.name), field.name, value)
                wrong += 1
    error = refused(fake_server.sessions.CreateSession, pb.CreateSessionRequest(config=config))
    assert len(error.violations) == wrong


def test_list_arguments(fake_server):
    error = refused(fake_server.sessions.ListSessions, pb.ListSessionsRequest(page_size=-1, page_token="?"))
    assert list(error.violations) == ["page_size", "page_token"]


def test_several_lasers_must_be_named(fake_server):
    lasers = [LaserMounting(sensor_id="front"), LaserMounting(sensor_id="rear", pose=Pose2D(x_meters=-0.4))]
    fake_server.client.create_session("two", lasers=lasers)
    fake_server.client.add_odometry("two", 0, 0.0, 0.0, 0.0)
    request = mapping.AddLaserScanRequest(session_id="two", scan=scan_message())
    assert list(refused(fake_server.mapping.AddLaserScan, request).violations) == ["scan.sensor_id"]
    request.scan.sensor_id = "rear"
    fake_server.mapping.AddLaserScan(request, timeout=20.0)
    assert fake_server.mappers[0].scans[0].base_from_laser.tolist() == [-0.4, 0.0, 0.0]


def stream_error(fake_server, *requests):
    return refused(lambda *a, **o: list(fake_server.mapping.StreamSensorData(*a, **o)), iter(requests))


def test_stream_framing(fake_server, session):
    start = mapping.StreamSensorDataRequest(start=mapping.StreamStart(session_id=session))
    batch = mapping.StreamSensorDataRequest(batch=mapping.SensorBatch())
    empty = mapping.StreamSensorDataRequest()
    items = [sensor_item(k, Odometry()) for k in range(1, 1026)]
    too_large = mapping.StreamSensorDataRequest(batch=mapping.SensorBatch(items=items))
    bad_id = mapping.StreamSensorDataRequest(start=mapping.StreamStart(session_id="!"))
    assert list(stream_error(fake_server).violations) == ["payload"]
    assert list(stream_error(fake_server, batch).violations) == ["payload"]
    assert list(stream_error(fake_server, bad_id).violations) == ["start.session_id"]
    assert list(stream_error(fake_server, start, start).violations) == ["payload"]
    assert list(stream_error(fake_server, start, empty).violations) == ["payload"]
    assert list(stream_error(fake_server, start, too_large).violations) == ["batch.items"]
