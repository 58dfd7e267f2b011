"""Items that the filter itself rejects: a status where they come alone, a verdict in a stream."""

import grpc
import numpy as np
import pytest
from gridwright.v1.sensor_pb2 import (
    VERDICT_PROCESSED,
    VERDICT_REJECTED_NO_ODOMETRY,
    VERDICT_REJECTED_OUT_OF_ORDER,
    VERDICT_REJECTED_OUTSIDE_MAP,
)
from gridwright_client import GridwrightRpcError, MappingClient
from gridwright_client.items import odometry, sensor_item
from gridwright_client.local_server import local_server
from support import SECOND_NS, scan_message

GEOMETRY = {"angle_min_rad": -1.0, "angle_increment_rad": 0.1, "range_min_m": 0.1, "range_max_m": 9.0}


@pytest.fixture(scope="module")
def client():
    with local_server(threads=1) as address, MappingClient(address) as client:
        client.wait_until_serving()
        yield client


def add_scan(client, session_id, stamp_s):
    return client.add_scan(session_id, int(stamp_s * SECOND_NS), np.full(21, 2.0), **GEOMETRY)


def refusal(call, *arguments):
    with pytest.raises(GridwrightRpcError) as caught:
        call(*arguments)
    return caught.value.code, caught.value.reason


def test_alone_they_get_a_status(client):
    client.create_session("alone")
    expected = (grpc.StatusCode.FAILED_PRECONDITION, "NO_ODOMETRY")
    assert refusal(add_scan, client, "alone", 10) == expected

    client.add_odometry("alone", 10 * SECOND_NS, 0.0, 0.0, 0.0)
    assert add_scan(client, "alone", 10).verdict == VERDICT_PROCESSED
    expected = (grpc.StatusCode.OUT_OF_RANGE, "OUT_OF_ORDER")
    assert refusal(add_scan, client, "alone", 7) == expected
    assert refusal(client.add_odometry, "alone", 7 * SECOND_NS, 0.0, 0.0, 0.0) == expected
    add_scan(client, "alone", 9)  # a second back is what real logs do

    client.add_odometry("alone", 11 * SECOND_NS, 1e5, 0.0, 0.0)
    expected = (grpc.StatusCode.RESOURCE_EXHAUSTED, "MAP_TOO_LARGE")
    assert refusal(add_scan, client, "alone", 11) == expected

    counts = client.get_session("alone").counts
    assert (counts.rejected_no_odometry, counts.rejected_out_of_order, counts.rejected_outside_map) == (
        1,
        2,
        1,
    )


def test_in_a_stream_they_get_a_verdict_and_it_goes_on(client):
    client.create_session("stream")
    data = [
        scan_message(10 * SECOND_NS),
        odometry(10 * SECOND_NS, 0.0, 0.0, 0.0),
        scan_message(7 * SECOND_NS),
        scan_message(10 * SECOND_NS),
        odometry(11 * SECOND_NS, 1e5, 0.0, 0.0),
        scan_message(11 * SECOND_NS),
    ]
    items = [sensor_item(number, item) for number, item in enumerate(data, start=1)]
    assert [verdict.verdict for verdict in client.stream("stream", items)] == [
        VERDICT_REJECTED_NO_ODOMETRY,
        VERDICT_PROCESSED,
        VERDICT_REJECTED_OUT_OF_ORDER,
        VERDICT_PROCESSED,
        VERDICT_PROCESSED,
        VERDICT_REJECTED_OUTSIDE_MAP,
    ]
