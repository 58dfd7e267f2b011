"""Fixtures of the mapper's tests."""

from concurrent.futures import ThreadPoolExecutor

import pytest
from gridwright_server.slam.mapper import Mapper
from mapped_room import CONFIG


@pytest.fixture(scope="module")
def workers():
    with ThreadPoolExecutor(4) as pool:
        yield pool


@pytest.fixture
def mapper(workers):
    return Mapper(CONFIG, 1, workers, 2)
