"""The part of `gridwright replay` that talks to a server."""

import signal
import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, nullcontext
from types import FrameType

import grpc
from rich.console import Console

from gridwright_client.carmen import CarmenLog
from gridwright_client.cli.options import fail
from gridwright_client.client import MappingClient
from gridwright_client.errors import GridwrightRpcError
from gridwright_client.local_server import ServerNotInstalledError, local_server
from gridwright_client.replay.events import Event, ScanEvent, robot_seconds
from gridwright_client.replay.mapping import Mapped, ReplayOptions, replay_events
from gridwright_client.replay.progress import ReplayProgress

CONNECT_TIMEOUT_S = 10.0
_WARM_UP_TIMEOUT_S = 600.0


def map_events(
    to: Console,
    address: str | None,
    threads: int | None,
    log: CarmenLog,
    events: list[Event],
    options: ReplayOptions,
) -> tuple[Mapped, bool]:
    """Maps through the server at an address, or one in this process; tells whether Ctrl-C cut it short."""
    stop = threading.Event()
    scan_count = sum(isinstance(event, ScanEvent) for event in events)
    with ExitStack() as stack:
        try:
            at = stack.enter_context(nullcontext(address) if address else local_server(threads))
        except ServerNotInstalledError as error:
            fail(str(error))
        client = stack.enter_context(_connected(to, at))
        progress = stack.enter_context(ReplayProgress(to, scan_count, robot_seconds(events)))
        stack.enter_context(_interrupt_sets(stop))
        try:
            mapped = replay_events(
                client, events, log.base_from_laser, options, stop=stop, on_progress=progress.update
            )
        except GridwrightRpcError as error:
            fail(_rpc_error_text(error, at))
    return mapped, stop.is_set()


@contextmanager
def _connected(to: Console, address: str) -> Iterator[MappingClient]:
    """A client of a server that serves: a fresh one compiles for a minute or two first."""
    with grpc.insecure_channel(address) as channel:
        try:
            grpc.channel_ready_future(channel).result(CONNECT_TIMEOUT_S)
        except grpc.FutureTimeoutError:
            fail(f"no server answers at {address}: start one with `gridwright serve`, or leave out --server")
    with MappingClient(address) as client:
        try:
            with to.status("waiting for the server to be warm (its first start compiles for a minute)"):
                client.wait_until_serving(_WARM_UP_TIMEOUT_S)
        except GridwrightRpcError as error:
            fail(_rpc_error_text(error, address))
        yield client


@contextmanager
def _interrupt_sets(stop: threading.Event) -> Iterator[None]:
    """The first Ctrl-C sets the event; the second one aborts, as usual."""

    def handle(number: int, frame: FrameType | None) -> None:
        stop.set()
        signal.signal(signal.SIGINT, previous)

    previous = signal.getsignal(signal.SIGINT)
    signal.signal(signal.SIGINT, handle)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, previous)


def _rpc_error_text(error: GridwrightRpcError, address: str) -> str:
    if error.violations:
        listed = "; ".join(f"{field}: {what}" for field, what in error.violations.items())
        return f"the server does not accept the replay's settings: {listed}"
    return f"the server at {address} failed: {error}"
