"""What tests of the server share: a server around fake mappers, and things to send to it."""

import threading

import grpc
import numpy as np
from fake_mapper import FakeMapper
from gridwright.v1.mapping_service_pb2_grpc import MappingServiceStub
from gridwright.v1.session_service_pb2_grpc import SessionServiceStub
from gridwright_client.client import MappingClient
from gridwright_client.items import laser_scan, odometry, sensor_item
from gridwright_server.app import start_server

SECOND_NS = 1_000_000_000


class FakeServer:
    """A real server around fake mappers, and every kind of client of it."""

    def __init__(self, **options):
        self.mappers = []
        options.setdefault("warm_up", lambda: None)
        self.server = start_server("127.0.0.1:0", threads=1, mapper_factory=self._mapper, **options)
        self.address = self.server.address
        self.channel = grpc.insecure_channel(self.address)
        self.sessions = SessionServiceStub(self.channel)
        self.mapping = MappingServiceStub(self.channel)
        self.client = MappingClient(self.address, timeout_s=20.0)

    def _mapper(self, *arguments):
        self.mappers.append(FakeMapper(*arguments))
        return self.mappers[-1]

    def stop(self):
        for mapper in self.mappers:
            mapper.release()
        self.client.close()
        self.channel.close()
        self.server.stop(grace_s=1.0)


def scan_message(stamp_ns=SECOND_NS, ranges_m=(1.0, 2.0, 3.0), **fields):
    geometry = {
        "angle_min_rad": -1.0,
        "angle_increment_rad": 0.5,
        "range_min_m": 0.1,
        "range_max_m": 30.0,
    }
    return laser_scan(stamp_ns, np.array(ranges_m, dtype=np.float32), **{**geometry, **fields})


def drive(count, first=1):
    """`count` items: an odometry reading, then scans and readings in turn."""
    for number in range(first, first + count):
        stamp_ns = number * SECOND_NS
        data = odometry(stamp_ns, 0.1 * number, 0.0, 0.01) if number % 2 else scan_message(stamp_ns)
        yield sensor_item(number, data)


def until_error(stream):
    """What a stream gave and the error that ended it."""
    received = []
    try:
        for element in stream:
            received.append(element)
    except Exception as error:
        return received, error
    raise AssertionError("the stream ended well")


class Feed:
    """An iterable of requests that a test fills by hand."""

    def __init__(self):
        self._requests = []
        self._closed = False
        self._changed = threading.Condition()

    def put(self, request):
        with self._changed:
            self._requests.append(request)
            self._changed.notify_all()

    def close(self):
        with self._changed:
            self._closed = True
            self._changed.notify_all()

    def __iter__(self):
        return self

    def __next__(self):
        with self._changed:
            while not self._requests and not self._closed:
                self._changed.wait()
            if self._requests:
                return self._requests.pop(0)
            raise StopIteration
