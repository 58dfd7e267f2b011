"""What the client does that the server's tests do not already show."""

import socket
import threading

import grpc
import numpy as np
import pytest
from fake_mapper import FakeMapper
from gridwright_client.client import MappingClient
from gridwright_client.errors import GridwrightRpcError
from gridwright_server.address import check
from gridwright_server.app import start_server
from support import SECOND_NS, Feed, drive


def test_scans_and_odometry_one_by_one(fake_server):
    client = fake_server.client
    client.create_session("a")
    client.add_odometry("a", SECOND_NS, 1.0, 2.0, 0.5)
    response = client.add_scan(
        "a", 2 * SECOND_NS, np.array([1.0, np.nan, np.inf]), angle_min_rad=-1.0, angle_increment_rad=1.0,
        range_min_m=0.1, range_max_m=10.0, sensor_id="laser",
    )  # fmt: skip
    assert response.pose == client.pose("a")
    [scan] = fake_server.mappers[0].scans
    assert scan.bearings_rad.tolist() == [-1.0, 0.0, 1.0]
    assert (scan.range_min_m, scan.range_max_m) == (0.1, 10.0)
    assert scan.stamp_ns == 2 * SECOND_NS


def test_a_server_that_is_not_there():
    with MappingClient("127.0.0.1:1", timeout_s=5.0) as client:
        with pytest.raises(GridwrightRpcError) as caught:
            client.get_session("a")
        assert caught.value.retryable
        assert caught.value.reason == ""
        with pytest.raises(GridwrightRpcError) as caught:
            client.wait_until_serving(0.2)
        assert caught.value.code is grpc.StatusCode.DEADLINE_EXCEEDED


def test_wait_until_serving_outlasts_a_server_that_comes_later():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        address = f"127.0.0.1:{probe.getsockname()[1]}"
    check(address)
    with MappingClient(address) as client:
        waiting = threading.Thread(target=client.wait_until_serving, args=(30.0,))
        waiting.start()
        server = start_server(address, mapper_factory=FakeMapper, warm_up=lambda: None)
        waiting.join(30.0)
        assert not waiting.is_alive()
        server.stop(1.0)


def test_errors_are_readable(fake_server):
    with pytest.raises(GridwrightRpcError) as caught:
        fake_server.client.create_session("Not An Id")
    error = caught.value
    assert str(error).startswith("INVALID_ARGUMENT INVALID_FIELDS: session_id: must consist of")
    assert error.violations == {"session_id": "must consist of 1 to 63 of the characters a-z, 0-9 and -"}
    assert not error.retryable


def test_a_stream_left_early_is_cancelled(fake_server):
    feed = Feed()

    def items():
        yield from drive(3)
        yield from feed

    fake_server.client.create_session("a")
    stream = fake_server.client.stream("a", items(), batch_size=1)
    assert next(stream).sequence_number == 1
    stream.close()
    feed.close()
    assert fake_server.client.finish_session("a").counts.scans_processed <= 1


def test_no_items_give_no_verdicts(fake_server):
    fake_server.client.create_session("a")
    assert list(fake_server.client.stream("a", [])) == []
    assert fake_server.client.next_sequence_number("a") == 1


def test_a_batch_holds_at_least_one_item(fake_server):
    fake_server.client.create_session("a")
    with pytest.raises(ValueError, match="batch_size is 0"):
        list(fake_server.client.stream("a", drive(3), batch_size=0))


def test_list_sessions_turns_pages(fake_server, monkeypatch):
    monkeypatch.setattr("gridwright_server.api.convert.sessions._DEFAULT_PAGE", 2)
    for name in ("c", "a", "b", "e", "d"):
        fake_server.client.create_session(name)
    assert [session.session_id for session in fake_server.client.list_sessions()] == list("abcde")
