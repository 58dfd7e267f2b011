"""The life of sessions, and what can be read of them."""

import threading

import grpc
import numpy as np
import pytest
from fake_mapper import SECRET, FakeSnapshot
from gridwright.v1 import mapping_service_pb2 as mapping
from gridwright.v1 import session_service_pb2 as pb
from gridwright_client.errors import GridwrightRpcError
from gridwright_server.config import MapperConfig
from support import drive, scan_message

LARGEST_MAP_MESSAGE = 1 << 20


def failure(call, *arguments, **options):
    with pytest.raises(GridwrightRpcError) as caught:
        call(*arguments, **options)
    return caught.value.code, caught.value.reason


def test_the_effective_configuration_is_complete(fake_server):
    config = pb.MapperConfig(particles=7, grid=pb.GridConfig(resolution_meters=0.1))
    session = fake_server.client.create_session("a", config=config, seed=2**64 - 1)
    assert session.seed == 2**64 - 1
    assert session.config.particles == 7
    assert session.config.grid.resolution_meters == 0.1
    assert session.config.matching.window_meters == MapperConfig().matching.window_meters
    for stage in pb.MapperConfig.DESCRIPTOR.fields:
        assert session.config.HasField(stage.name)
        for field in stage.message_type.fields if stage.message_type else ():
            assert getattr(session.config, stage.name).HasField(field.name), field.full_name
    assert [laser.sensor_id for laser in session.lasers] == ["laser"]
    assert fake_server.client.get_session("a") == session


def test_zero_is_a_value_not_an_absence(fake_server):
    config = pb.MapperConfig(motion=pb.MotionConfig(update_distance_meters=0.0))
    session = fake_server.client.create_session(config=config)
    assert session.config.motion.update_distance_meters == 0.0


def test_ids_are_generated_or_unique(fake_server):
    first, second = (fake_server.client.create_session().session_id for _ in range(2))
    assert first != second
    code = grpc.StatusCode.ALREADY_EXISTS
    assert failure(fake_server.client.create_session, first) == (code, "SESSION_EXISTS")


def test_sixty_four_sessions_and_no_more(fake_server):
    names = [f"s{k:02}" for k in range(64)]
    for name in names:
        fake_server.client.create_session(name)
    code = grpc.StatusCode.RESOURCE_EXHAUSTED
    assert failure(fake_server.client.create_session) == (code, "TOO_MANY_SESSIONS")
    assert [session.session_id for session in fake_server.client.list_sessions()] == names
    page = fake_server.sessions.ListSessions(pb.ListSessionsRequest(page_size=60, page_token="s01"))
    assert [session.session_id for session in page.sessions] == names[2:62]
    assert page.next_page_token == "s61"
    fake_server.client.delete_session("s00")
    fake_server.client.create_session("s64")


def test_unknown_sessions(fake_server):
    client = fake_server.client
    calls = [client.get_session, client.finish_session, client.delete_session, client.pose, client.map]
    for call in [*calls, client.trajectory, client.next_sequence_number]:
        assert failure(call, "nobody") == (grpc.StatusCode.NOT_FOUND, "SESSION_NOT_FOUND")
    expected = (grpc.StatusCode.NOT_FOUND, "SESSION_NOT_FOUND")
    assert failure(client.add_odometry, "nobody", 1, 0.0, 0.0, 0.0) == expected


def test_reads_before_any_scan(fake_server):
    fake_server.client.create_session("a")
    expected = (grpc.StatusCode.FAILED_PRECONDITION, "NO_SCAN_YET")
    assert failure(fake_server.client.pose, "a") == expected
    assert failure(fake_server.client.map, "a") == expected
    trajectory = fake_server.client.trajectory("a")
    assert trajectory.poses.shape == (0, 3)


def test_a_scan_before_odometry_is_rejected(fake_server):
    fake_server.client.create_session("a")
    with pytest.raises(grpc.RpcError) as refusal:
        fake_server.mapping.AddLaserScan(
            mapping.AddLaserScanRequest(session_id="a", scan=scan_message()), timeout=20.0
        )
    assert refusal.value.code() is grpc.StatusCode.FAILED_PRECONDITION
    assert fake_server.client.get_session("a").counts.rejected_no_odometry == 1
    assert failure(fake_server.client.pose, "a")[1] == "NO_SCAN_YET"


def test_pose_has_its_frames(fake_server):
    fake_server.client.create_session("a")
    list(fake_server.client.stream("a", drive(2)))
    pose = fake_server.client.pose("a")
    assert (pose.frame_id, pose.child_frame_id, pose.particle_count) == ("map", "base_link", 2)
    assert list(pose.covariance) == [0.01, 0, 0, 0, 0.01, 0, 0, 0, 0.01]
    assert pose.stamp.seconds == 2


def test_map_messages_are_small_and_add_up(fake_server):
    fake_server.client.create_session("a")
    [mapper] = fake_server.mappers
    mapper.tiles = 700
    list(fake_server.client.stream("a", drive(2)))
    responses = list(fake_server.mapping.GetMap(mapping.GetMapRequest(session_id="a"), timeout=20.0))
    assert max(response.ByteSize() for response in responses) < LARGEST_MAP_MESSAGE
    assert len(responses) > 3
    assert sum(len(response.tiles.tiles) for response in responses) == responses[0].header.tile_count == 700

    grid = fake_server.client.map("a")
    snapshot = FakeSnapshot(700, 1)
    for tile, (column, row) in enumerate(snapshot.tile_origins):
        first_row, first_column = row - grid.min_row, column - grid.min_column
        cells = grid.cells[first_row : first_row + 64, first_column : first_column + 64]
        np.testing.assert_array_equal(cells, snapshot.occupancy(tile))
    assert (grid.cells == -1).sum() == grid.cells.size - 700 * 64 * 64
    assert all(snapshot.closed.wait(10.0) for snapshot in mapper.snapshots)
    again = fake_server.client.map("a")
    assert again.version == grid.version


def test_an_abandoned_map_gives_its_tiles_back(fake_server):
    fake_server.client.create_session("a")
    [mapper] = fake_server.mappers
    mapper.tiles = 10_000
    list(fake_server.client.stream("a", drive(2)))
    call = fake_server.mapping.GetMap(mapping.GetMapRequest(session_id="a"), timeout=20.0)
    next(call)
    call.cancel()
    assert mapper.snapshots[0].closed.wait(10.0)


def test_reads_go_before_what_is_queued(fake_server):
    """While a scan is worked on and others wait, a read waits for that one scan only."""
    fake_server.client.create_session("a")
    [mapper] = fake_server.mappers
    list(fake_server.client.stream("a", drive(2)))
    mapper.entered.clear()
    mapper.hold()
    sender = threading.Thread(target=lambda: list(fake_server.client.stream("a", drive(100, first=3))))
    sender.start()
    assert mapper.entered.wait(20.0)
    watched = fake_server.server._parts.registry.get("a")
    poll = threading.Event()
    while watched.next_sequence_number < 103:
        poll.wait(0.005)
    result = []
    reader = threading.Thread(target=lambda: result.append(fake_server.client.trajectory("a")))
    reader.start()
    while not watched._inbox._calls:
        poll.wait(0.005)
    mapper.release()
    reader.join()
    sender.join()
    assert len(result[0].stamps_ns) == 2


def test_long_trajectories_come_in_parts(fake_server):
    fake_server.client.create_session("a")
    list(fake_server.client.stream("a", drive(20_000)))
    responses = list(
        fake_server.mapping.GetTrajectory(mapping.GetTrajectoryRequest(session_id="a"), timeout=20.0)
    )
    assert len(responses) == 3
    assert max(response.ByteSize() for response in responses) < LARGEST_MAP_MESSAGE
    trajectory = fake_server.client.trajectory("a")
    assert len(trajectory.stamps_ns) == 10_000
    assert trajectory.processed.tolist()[:4] == [True, True, False, True]
    np.testing.assert_array_equal(trajectory.stamps_ns[:2], [2 * 10**9, 4 * 10**9])


def test_sessions_do_not_disturb_each_other(fake_server):
    names = [f"robot-{k}" for k in range(8)]
    for seed, name in enumerate(names):
        fake_server.client.create_session(name, seed=seed)
    verdicts = {}

    def send(name):
        verdicts[name] = list(fake_server.client.stream(name, drive(400), want_poses=True))

    threads = [threading.Thread(target=send, args=(name,)) for name in names]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for seed, name in enumerate(names):
        alone = fake_server.client.create_session(seed=seed).session_id
        assert verdicts[name] == list(fake_server.client.stream(alone, drive(400), want_poses=True))


def test_internal_errors_tell_an_incident_and_nothing_else(fake_server, monkeypatch, caplog):
    fake_server.client.create_session("a")
    [mapper] = fake_server.mappers

    def broken():
        raise RuntimeError(SECRET)

    monkeypatch.setattr(mapper, "trajectory", broken)
    monkeypatch.setattr(mapper, "map_snapshot", broken)
    monkeypatch.setattr(fake_server.server._parts.registry, "page", lambda *_: broken())
    for call in (
        fake_server.client.trajectory,
        fake_server.client.map,
        lambda _: list(fake_server.client.list_sessions()),
    ):
        with pytest.raises(GridwrightRpcError) as caught:
            call("a")
        assert caught.value.code is grpc.StatusCode.INTERNAL
        assert SECRET not in str(caught.value)
        assert caught.value.metadata["incident"] in caplog.text
