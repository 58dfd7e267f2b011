"""Start, health, reflection and stop of a server in this process."""

import socket
import threading

import grpc
import pytest
from gridwright.v1 import mapping_service_pb2 as mapping
from gridwright_client.errors import GridwrightRpcError
from gridwright_server.address import AddressError, check
from gridwright_server.app import start_server
from grpc_health.v1.health_pb2 import HealthCheckRequest, HealthCheckResponse
from grpc_health.v1.health_pb2_grpc import HealthStub
from grpc_reflection.v1alpha.proto_reflection_descriptor_database import ProtoReflectionDescriptorDatabase
from support import drive

SERVICES = ("", "gridwright.v1.SessionService", "gridwright.v1.MappingService")


def health(server):
    stub = HealthStub(server.channel)
    return {stub.Check(HealthCheckRequest(service=name), timeout=20.0).status for name in SERVICES}


def test_not_serving_until_warm(start_fake_server):
    warm = threading.Event()
    server = start_fake_server(warm_up=warm.wait)
    try:
        assert health(server) == {HealthCheckResponse.NOT_SERVING}
        with pytest.raises(GridwrightRpcError) as caught:
            server.client.create_session("a")
        assert (caught.value.code, caught.value.reason) == (grpc.StatusCode.UNAVAILABLE, "WARMING_UP")
        assert caught.value.retryable
        with pytest.raises(GridwrightRpcError, match="WARMING_UP"):
            list(server.client.stream("a", drive(1)))
        with pytest.raises(GridwrightRpcError) as caught:
            server.client.wait_until_serving(0.2)
        assert caught.value.code is grpc.StatusCode.DEADLINE_EXCEEDED
    finally:
        warm.set()
    server.client.wait_until_serving(20.0)
    assert health(server) == {HealthCheckResponse.SERVING}
    server.client.create_session("a")


def test_a_failed_start_up_is_reported(start_fake_server, caplog):
    def warm_up():
        raise RuntimeError("no compiler")

    server = start_fake_server(warm_up=warm_up)
    with pytest.raises(RuntimeError, match="no compiler"):
        server.server.startup.result(20.0)
    assert health(server) == {HealthCheckResponse.NOT_SERVING}
    assert "no compiler" in caplog.text


def test_reflection_lists_the_services(fake_server):
    names = ProtoReflectionDescriptorDatabase(fake_server.channel).get_services()
    assert {*SERVICES[1:], "grpc.health.v1.Health"} <= set(names)


def test_stop_ends_streams_with_unavailable(start_fake_server, feed):
    server = start_fake_server()
    server.client.wait_until_serving(20.0)
    server.client.create_session("a")
    call = server.mapping.StreamSensorData(feed, timeout=20.0)
    feed.put(mapping.StreamSensorDataRequest(start=mapping.StreamStart(session_id="a")))
    feed.put(mapping.StreamSensorDataRequest(batch=mapping.SensorBatch(items=list(drive(10)))))
    next(call)
    received = 0
    while received < 10:
        received += len(next(call).verdicts.verdicts)
    server.server.stop(grace_s=5.0)
    with pytest.raises(grpc.RpcError) as caught:
        list(call)
    error = GridwrightRpcError(caught.value)
    assert (error.code, error.reason) == (grpc.StatusCode.UNAVAILABLE, "SERVER_STOPPING")
    server.server.wait()
    with pytest.raises(GridwrightRpcError) as caught:
        server.client.get_session("a")
    assert caught.value.retryable


def test_stop_is_prompt_with_a_full_queue(start_fake_server, feed):
    """Whoever waits for a verdict is told, and the session's thread ends."""
    server = start_fake_server()
    server.client.wait_until_serving(20.0)
    server.client.create_session("a")
    [mapper] = server.mappers
    mapper.hold()
    call = server.mapping.StreamSensorData(feed, timeout=60.0)
    feed.put(mapping.StreamSensorDataRequest(start=mapping.StreamStart(session_id="a")))
    feed.put(mapping.StreamSensorDataRequest(batch=mapping.SensorBatch(items=list(drive(1000)))))
    assert mapper.entered.wait(20.0)
    stopping = threading.Thread(target=server.server.stop, args=(0.5,))
    stopping.start()
    with pytest.raises(grpc.RpcError) as caught:
        list(call)
    assert caught.value.code() is grpc.StatusCode.UNAVAILABLE
    watched = server.server._parts.registry.get("a")
    poll = threading.Event()
    while watched._inbox._closing is None:
        poll.wait(0.005)
    mapper.release()
    stopping.join(20.0)
    assert not stopping.is_alive()
    assert len(mapper.scans) <= 2
    assert not [thread for thread in threading.enumerate() if thread.name == "session-a"]


def test_stopping_twice_and_while_warming_up(start_fake_server):
    warm = threading.Event()
    server = start_fake_server(warm_up=warm.wait)
    server.server.stop(grace_s=1.0)
    server.server.stop(grace_s=1.0)
    warm.set()
    server.server.startup.result(20.0)


def test_a_taken_port_is_an_error(fake_server):
    with pytest.raises(AddressError, match="is taken"):
        start_server(fake_server.address, warm_up=lambda: None)


@pytest.mark.parametrize(
    "address", ["", "localhost", "127.0.0.1:", ":5", "127.0.0.1:x", "127.0.0.1:70000", "127.0.0.1:-1"]
)
def test_what_is_no_address(address):
    with pytest.raises(AddressError, match="give host:port"):
        check(address)


def test_addresses_of_others():
    with pytest.raises(AddressError, match="not an address of this machine"):
        check("192.0.2.1:0")
    with pytest.raises(AddressError, match="cannot resolve"):
        check("no-such-host.invalid:0")


def test_a_free_port_is_no_error():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    check(f"127.0.0.1:{port}")
    check("localhost:0")
