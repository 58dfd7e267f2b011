"""Composition root: settings -> store -> sessions -> servicers -> gRPC server."""

import logging
import os
import threading
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path

import grpc
from gridwright.v1 import mapping_service_pb2, session_service_pb2
from gridwright.v1.mapping_service_pb2_grpc import add_MappingServiceServicer_to_server
from gridwright.v1.session_service_pb2_grpc import add_SessionServiceServicer_to_server
from grpc_health.v1 import health, health_pb2, health_pb2_grpc
from grpc_reflection.v1alpha import reflection

from gridwright_server import address as addresses
from gridwright_server.api.convert.sessions import RecordCodec
from gridwright_server.api.interceptor import EdgeInterceptor
from gridwright_server.api.mapping_servicer import MappingServicer
from gridwright_server.api.open_streams import OpenStreams
from gridwright_server.api.session_servicer import SessionServicer
from gridwright_server.config import MapperConfig
from gridwright_server.lifecycle import Lifecycle
from gridwright_server.session.items import MapperPort
from gridwright_server.session.registry import SessionRegistry
from gridwright_server.slam import mapper as slam
from gridwright_server.slam.types import Workers
from gridwright_server.store.store import Store

STREAM_LIMIT = 128
_UNARY_THREADS = 8  # every open stream has a thread of the pool for life; these are for other calls
_MOST_CALLS = 1024  # at a time, running or waiting for a thread
_LARGEST_MESSAGE_BYTES = 4 << 20

_SERVICES = (
    session_service_pb2.DESCRIPTOR.services_by_name["SessionService"].full_name,
    mapping_service_pb2.DESCRIPTOR.services_by_name["MappingService"].full_name,
)

_OPTIONS = [
    ("grpc.so_reuseport", 0),  # a second server on the port is an error, not a lottery
    ("grpc.max_receive_message_length", _LARGEST_MESSAGE_BYTES),
    ("grpc.keepalive_time_ms", 30_000),
    ("grpc.keepalive_timeout_ms", 20_000),
    ("grpc.http2.min_recv_ping_interval_without_data_ms", 10_000),  # clients may ping on idle streams
]

MapperFactory = Callable[[MapperConfig, int, Workers, int], MapperPort]
"""From configuration, seed, workers and their number."""

_logger = logging.getLogger(__name__)


class RunningServer:
    """A server that listens; it serves once `startup` is done."""

    def __init__(
        self,
        address: str,
        grpc_server: grpc.Server,
        parts: "_Parts",
        warm_up: Callable[[], None],
    ) -> None:
        self.address = address
        """host:port, with the port that was chosen."""
        self.port = int(address.rpartition(":")[2])
        self.startup: Future[None] = Future()
        """Done when the server serves; failed when it never will."""
        self._grpc_server = grpc_server
        self._parts = parts
        threading.Thread(target=self._start_up, args=(warm_up,), name="start-up", daemon=True).start()

    def wait(self) -> None:
        """Returns when the server has stopped."""
        self._grpc_server.wait_for_termination()

    def stop(self, grace_s: float) -> None:
        """Answers NOT_SERVING at once, ends open streams, lets other calls end within `grace_s`."""
        if not self._parts.lifecycle.stop():
            self.wait()
            return
        self._parts.health.enter_graceful_shutdown()
        self._parts.streams.stop()
        self._grpc_server.stop(grace_s).wait()
        self._parts.registry.close()
        self._parts.workers.shutdown(wait=False)
        _logger.info("stopped")

    def _start_up(self, warm_up: Callable[[], None]) -> None:
        try:
            warm_up()
            self._parts.registry.recover()
            if self._parts.lifecycle.serve():
                for service in ("", *_SERVICES):
                    self._parts.health.set(service, health_pb2.HealthCheckResponse.SERVING)
        except Exception as error:
            _logger.exception("the server could not start up")
            self.startup.set_exception(error)
        else:
            self.startup.set_result(None)


class _Parts:
    """What a server is made of."""

    def __init__(self, store: Store | None, threads: int, mapper_factory: MapperFactory) -> None:
        self.workers = ThreadPoolExecutor(threads, thread_name_prefix="particles")
        self.registry = SessionRegistry(
            lambda config, seed: mapper_factory(config, seed, self.workers, threads), RecordCodec(), store
        )
        self.streams = OpenStreams(STREAM_LIMIT)
        self.lifecycle = Lifecycle()
        self.health = health.HealthServicer()
        for service in ("", *_SERVICES):
            self.health.set(service, health_pb2.HealthCheckResponse.NOT_SERVING)


def start_server(
    address: str,
    *,
    data_dir: Path | None = None,
    threads: int | None = None,
    mapper_factory: MapperFactory = slam.Mapper,
    warm_up: Callable[[], None] = slam.warm_up,
) -> RunningServer:
    """Listens on host:port at once and serves when warm; port 0 = any free one.

    `threads` work on the particles of all sessions; None = one per CPU. Raises AddressError for an address
    that cannot be listened on, StoreLockedError and OSError for a data directory that cannot be used.
    """
    addresses.check(address)
    store = Store(data_dir) if data_dir is not None else None
    parts = _Parts(store, threads or os.cpu_count() or 1, mapper_factory)
    grpc_server = _grpc_server(parts)
    try:
        port = grpc_server.add_insecure_port(address)
    except RuntimeError as error:
        parts.registry.close()
        raise addresses.AddressError(f"cannot listen on {address}") from error
    grpc_server.start()
    host = address.rpartition(":")[0]
    return RunningServer(f"{host}:{port}", grpc_server, parts, warm_up)


def _grpc_server(parts: _Parts) -> grpc.Server:
    server = grpc.server(
        ThreadPoolExecutor(STREAM_LIMIT + _UNARY_THREADS, thread_name_prefix="rpc"),
        interceptors=[EdgeInterceptor(parts.lifecycle.check_serving)],
        options=_OPTIONS,
        maximum_concurrent_rpcs=_MOST_CALLS,
    )
    add_SessionServiceServicer_to_server(SessionServicer(parts.registry), server)
    add_MappingServiceServicer_to_server(MappingServicer(parts.registry, parts.streams), server)
    health_pb2_grpc.add_HealthServicer_to_server(parts.health, server)
    reflection.enable_server_reflection((*_SERVICES, health.SERVICE_NAME, reflection.SERVICE_NAME), server)
    return server
