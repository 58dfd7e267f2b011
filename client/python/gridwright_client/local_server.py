"""A mapping server inside this process: for replays without a server at hand, demos and tests."""

from collections.abc import Iterator
from contextlib import contextmanager


class ServerNotInstalledError(RuntimeError):
    """The server part of the distribution is missing."""


@contextmanager
def local_server(threads: int | None = None) -> Iterator[str]:
    """Runs a server on a loopback port and yields its address, such as 127.0.0.1:40123.

    It is reachable at once and serves when its kernels are warm: see
    MappingClient.wait_until_serving. `threads` work on the particles; None = one per CPU.
    """
    try:
        from gridwright_server.app import start_server
    except ModuleNotFoundError as error:
        raise ServerNotInstalledError(
            f"a server in this process needs the module {error.name}: pip install 'gridwright[server]'"
        ) from error
    server = start_server("127.0.0.1:0", threads=threads)
    try:
        yield server.address
    finally:
        server.stop(grace_s=5.0)
