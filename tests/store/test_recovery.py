"""A server that starts on the data of another one."""

import logging

import grpc
import pytest
from fake_mapper import BAD_STAMP_NS
from gridwright.v1 import mapping_service_pb2 as mapping
from gridwright.v1.geometry_pb2 import Pose2D
from gridwright.v1.sensor_pb2 import LaserMounting
from gridwright_client.errors import GridwrightRpcError
from gridwright_client.items import sensor_item
from gridwright_server.app import start_server
from gridwright_server.store.store import StoreLockedError
from support import drive, scan_message


@pytest.fixture
def start(start_fake_server, tmp_path):
    def start():
        server = start_fake_server(data_dir=tmp_path)
        server.client.wait_until_serving(20.0)
        return server

    return start


def test_sessions_outlive_their_server(start):
    lasers = [LaserMounting(sensor_id="front", pose=Pose2D(x_meters=0.1, theta_radians=0.3))]
    first = start()
    first.client.create_session("a", seed=5, lasers=lasers)
    list(first.client.stream("a", drive(100)))
    first.client.add_odometry("a", 3, 1.0, 2.0, 3.0)
    list(first.client.stream("a", [mapping.SensorItem(sequence_number=101), *drive(3, first=102)]))
    first.client.create_session("done")
    list(first.client.stream("done", drive(4)))
    first.client.finish_session("done")
    first.client.create_session("gone")
    first.client.delete_session("gone")
    before = {session.session_id: session for session in first.client.list_sessions()}
    pose = first.client.pose("a")
    first.stop()

    second = start()
    assert {session.session_id: session for session in second.client.list_sessions()} == before
    assert before["done"].state == 2
    assert second.client.pose("a") == pose
    assert second.client.next_sequence_number("a") == 105
    with pytest.raises(GridwrightRpcError, match="SESSION_FINISHED"):
        second.client.add_odometry("done", 1, 0.0, 0.0, 0.0)

    uninterrupted = second.client.create_session("b", seed=5, lasers=lasers).session_id
    list(second.client.stream(uninterrupted, drive(100)))
    second.client.add_odometry(uninterrupted, 3, 1.0, 2.0, 3.0)
    items = [mapping.SensorItem(sequence_number=101), *drive(23, first=102)]
    expected = list(second.client.stream(uninterrupted, items, want_poses=True))[4:]
    resumed = list(second.client.stream("a", drive(20, first=105), want_poses=True))
    assert resumed == expected


def test_a_failed_session_fails_again(start):
    first = start()
    first.client.create_session("a")
    items = [*drive(4), sensor_item(5, scan_message(BAD_STAMP_NS))]
    with pytest.raises(GridwrightRpcError, match="SESSION_FAILED"):
        list(first.client.stream("a", items))
    pose = first.client.pose("a")
    first.stop()
    second = start()
    assert second.client.get_session("a").state == 3
    assert second.client.pose("a") == pose


def damage_tail(data):
    return data[:-5]


def flip_a_bit(data):
    return data[:200] + bytes([data[200] ^ 4]) + data[201:]


def other_format(data):
    return data[:8] + bytes([2]) + data[9:]


def kept(server):
    return [session.session_id for session in server.client.list_sessions()]


@pytest.fixture
def journal(start, tmp_path):
    server = start()
    server.client.create_session("a")
    server.client.create_session("b")
    list(server.client.stream("a", drive(40)))
    server.stop()
    return tmp_path / "a.journal"


def test_a_torn_tail_loses_the_last_item_only(start, journal, caplog):
    journal.write_bytes(damage_tail(journal.read_bytes()))
    server = start()
    assert kept(server) == ["a", "b"]
    assert server.client.next_sequence_number("a") == 40
    assert "cut off a torn record" in caplog.text
    assert len(list(server.client.stream("a", drive(5, first=40)))) == 5


@pytest.mark.parametrize("damage", [flip_a_bit, other_format])
def test_a_corrupt_journal_is_refused_and_left_alone(start, journal, caplog, damage):
    damaged = damage(journal.read_bytes())
    journal.write_bytes(damaged)
    with caplog.at_level(logging.ERROR):
        server = start()
    assert kept(server) == ["b"]
    assert "session a is refused, its journal left as it is" in caplog.text
    with pytest.raises(GridwrightRpcError) as caught:
        server.client.create_session("a")
    assert caught.value.code is grpc.StatusCode.ALREADY_EXISTS
    server.stop()
    assert journal.read_bytes() == damaged


def test_a_journal_under_another_name_is_refused(start, journal, caplog):
    journal.rename(journal.with_name("c.journal"))
    assert kept(start()) == ["b"]
    assert "it is the journal of session a" in caplog.text


def test_a_second_server_is_refused(start, tmp_path):
    start()
    with pytest.raises(StoreLockedError):
        start_server("127.0.0.1:0", data_dir=tmp_path, warm_up=lambda: None)


def test_a_disk_that_takes_no_more_fails_the_session_only(start, monkeypatch):
    server = start()
    server.client.create_session("a")
    list(server.client.stream("a", drive(4)))
    journal = server.server._parts.registry.get("a")._journal

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(journal, "append", full)
    with pytest.raises(GridwrightRpcError, match="SESSION_FAILED"):
        list(server.client.stream("a", drive(1, first=5)))
    assert server.client.pose("a")
    server.client.create_session("b")
