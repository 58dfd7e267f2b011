"""`gridwright serve`."""

import logging
import os
import signal
import threading
from concurrent.futures import Future
from pathlib import Path
from types import FrameType

import click

STOP_GRACE_S = 5.0
STOP_LIMIT_S = 9.0
_LOG_FORMAT = "%(asctime)s %(levelname)s %(name)s: %(message)s"


@click.command()
@click.option("--address", default="127.0.0.1:50051", show_default=True, help="Listen here (host:port).")
@click.option(
    "--data-dir",
    type=click.Path(path_type=Path, file_okay=False),
    help="Keep sessions here, so that they outlive the server; without it nothing is kept.",
)
@click.option(
    "--threads", type=click.IntRange(1, 1024), help="Threads for the particles [default: one per CPU]."
)
@click.option(
    "--log-level",
    type=click.Choice(["debug", "info", "warning", "error"]),
    default="info",
    show_default=True,
)
def serve(address: str, data_dir: Path | None, threads: int | None, log_level: str) -> None:
    """Run a mapping server until SIGTERM or SIGINT.

    It speaks gRPC without encryption or access control: listen beyond this machine only on a
    network whose every member you trust.
    """
    from gridwright_server.address import AddressError
    from gridwright_server.app import start_server
    from gridwright_server.store.store import StoreLockedError

    logging.basicConfig(level=log_level.upper(), format=_LOG_FORMAT)
    stop = _stop_event()
    try:
        server = start_server(address, data_dir=data_dir, threads=threads)
    except (AddressError, StoreLockedError) as error:
        raise _NotStartedError(str(error)) from error
    except OSError as error:
        raise _NotStartedError(
            f"cannot use the data directory {data_dir}: {error.strerror}; choose one that can be written"
        ) from error
    click.echo(f"listening on {server.address}, warming up")
    server.startup.add_done_callback(lambda startup: _report(startup, server.address, stop))
    stop.wait()
    click.echo("stopping")
    _force_exit_after(STOP_LIMIT_S)
    server.stop(STOP_GRACE_S)
    if not server.startup.done():
        os._exit(0)  # a kernel being compiled cannot be interrupted
    if server.startup.exception() is not None:
        raise click.ClickException("the server could not start up: see the log")


class _NotStartedError(click.ClickException):
    """A setting that the server cannot work with."""

    exit_code = 2


def _stop_event() -> threading.Event:
    """Set by SIGTERM and SIGINT; a second signal ends the process at once."""
    stop = threading.Event()

    def on_signal(number: int, frame: FrameType | None) -> None:
        if stop.is_set():
            os._exit(1)
        stop.set()

    signal.signal(signal.SIGTERM, on_signal)
    signal.signal(signal.SIGINT, on_signal)
    return stop


def _report(startup: Future[None], address: str, stop: threading.Event) -> None:
    if startup.exception() is not None:
        stop.set()
    elif not stop.is_set():
        click.echo(f"serving on {address}")


def _force_exit_after(seconds: float) -> None:
    """Whatever a session is still computing is not worth waiting for."""
    timer = threading.Timer(seconds, os._exit, [0])
    timer.daemon = True
    timer.start()
