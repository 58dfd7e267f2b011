"""Fixtures of the tests: servers, and what is fed to them."""

import os
from pathlib import Path

import pytest
from support import FakeServer, Feed


@pytest.fixture
def fake_server():
    server = FakeServer()
    server.client.wait_until_serving(10.0)
    yield server
    server.stop()


@pytest.fixture
def start_fake_server():
    """Starts servers with options of one's own and stops them at the end."""
    started = []

    def start(**options):
        started.append(FakeServer(**options))
        return started[-1]

    yield start
    for server in started:
        server.stop()


@pytest.fixture
def feed():
    feed = Feed()
    yield feed
    feed.close()


@pytest.fixture(scope="session")
def recorded_logs():
    """The folder of recorded logs: GRIDWRIGHT_DATA, or a folder `shared/data` beside the checkout."""
    default = Path(__file__).parents[2] / "shared" / "data"
    folder = Path(os.environ.get("GRIDWRIGHT_DATA", default))
    if not (folder / "intel" / "intel.clf").is_file():
        pytest.skip(f"no recorded logs in {folder}: GRIDWRIGHT_DATA names the folder of intel/intel.clf")
    return folder
