"""`gridwright serve` as a process of its own: what it prints, how it ends, what it keeps."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import grpc
import numpy as np
import pytest
from gridwright_client.client import MappingClient
from gridwright_client.errors import GridwrightRpcError
from grpc_health.v1.health_pb2 import HealthCheckRequest, HealthCheckResponse
from grpc_health.v1.health_pb2_grpc import HealthStub
from support import SECOND_NS, Feed, drive

FAKE = [sys.executable, str(Path(__file__).parents[1] / "serve_fake.py")]
REAL = [str(Path(sys.executable).with_name("gridwright"))]


class Served:
    """A server's process, its address read from what it prints."""

    def __init__(self, command, *arguments, environment=None):
        self.process = subprocess.Popen(
            [*command, "serve", "--address", "127.0.0.1:0", *map(str, arguments)],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            env={**os.environ, **(environment or {})},
        )
        line = self.process.stdout.readline()
        assert line.startswith("listening on 127.0.0.1:"), line + self.process.stderr.read()
        self.address = line.split()[2].rstrip(",")

    def serving(self):
        assert self.process.stdout.readline() == f"serving on {self.address}\n"
        return self

    def end(self, number=signal.SIGTERM):
        """(exit code, the rest of what it printed, its log)"""
        self.process.send_signal(number)
        out, err = self.process.communicate(timeout=20.0)
        return self.process.returncode, out, err


@pytest.fixture
def serve():
    served = []

    def start(*arguments, command=FAKE, environment=None):
        served.append(Served(command, *arguments, environment=environment))
        return served[-1]

    yield start
    for server in served:
        server.process.kill()
        server.process.communicate()


def refused(*arguments):
    result = subprocess.run(
        [*FAKE, "serve", *map(str, arguments)], capture_output=True, text=True, timeout=60, check=False
    )
    assert result.returncode == 2
    [line] = result.stderr.splitlines()
    return line


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_signal_ends_open_streams_and_exits_0(serve, number):
    server = serve().serving()
    feed = Feed()
    with MappingClient(server.address) as client:
        client.create_session("a")
        received = client.stream("a", endless(feed), batch_size=1)
        for _ in range(5):
            next(received)
        code, out, err = server.end(number)
        with pytest.raises(GridwrightRpcError) as caught:
            list(received)
    assert (caught.value.code, caught.value.reason) == (grpc.StatusCode.UNAVAILABLE, "SERVER_STOPPING")
    assert (code, out) == (0, "stopping\n")
    assert "Traceback" not in err
    feed.close()


def endless(feed):
    yield from drive(5)
    yield from feed


def test_a_signal_while_warming_up(serve):
    server = serve(environment={"FAKE_WARM_UP": "never"})
    with grpc.insecure_channel(server.address) as channel:
        answer = HealthStub(channel).Check(HealthCheckRequest(), timeout=20.0)
    assert answer.status == HealthCheckResponse.NOT_SERVING
    assert server.end()[0] == 0


def test_a_failed_start_up_ends_it_with_code_1(serve):
    server = serve(environment={"FAKE_WARM_UP": "fails"})
    _, err = server.process.communicate(timeout=20.0)
    assert server.process.returncode == 1
    assert "no compiler" in err
    assert err.endswith("Error: the server could not start up: see the log\n")


def test_a_taken_port_is_one_line_and_code_2(serve):
    server = serve().serving()
    line = refused("--address", server.address)
    assert line == f"Error: {server.address} is taken by another program: stop it or choose another port"


def test_a_bad_address_is_one_line_and_code_2():
    assert "is no address: give host:port" in refused("--address", "nowhere")


def test_a_data_directory_that_cannot_be_used(tmp_path):
    (tmp_path / "file").write_text("")
    assert "cannot use the data directory" in refused(
        "--address", "127.0.0.1:0", "--data-dir", tmp_path / "file" / "below"
    )


def test_a_data_directory_in_use(serve, tmp_path):
    serve("--data-dir", tmp_path).serving()
    line = refused("--address", "127.0.0.1:0", "--data-dir", tmp_path)
    assert line == f"Error: another server works in {tmp_path}"


def test_kill_9_loses_nothing_that_was_answered(serve, tmp_path):
    server = serve("--data-dir", tmp_path).serving()
    poses = []
    with MappingClient(server.address) as client:
        client.create_session("a", seed=3)
        for verdict in client.stream("a", drive(100_000), want_poses=True, batch_size=16):
            poses.append(verdict)
            if len(poses) == 2000:
                server.process.kill()
                break
    server.process.communicate()

    again = serve("--data-dir", tmp_path).serving()
    with MappingClient(again.address) as client:
        resume_at = client.next_sequence_number("a")
        assert resume_at > 2000
        replayed = list(client.stream("a", drive(200, first=resume_at), want_poses=True))
        client.create_session("b", seed=3)
        expected = list(client.stream("b", drive(resume_at + 199), want_poses=True))
    assert replayed == expected[resume_at - 1 :]
    assert poses == expected[: len(poses)]
    assert again.end()[0] == 0


@pytest.fixture
def stuck(serve):
    """A server told to stop while a scan is in the works that will never be done."""
    server = serve(environment={"FAKE_SCANS": "never"}).serving()
    feed = Feed()
    with MappingClient(server.address) as client:
        client.create_session("a")
        received = client.stream("a", endless(feed), batch_size=1)
        next(received)
        server.process.send_signal(signal.SIGTERM)
        assert server.process.stdout.readline() == "stopping\n"
        yield server
    feed.close()


def test_stopping_takes_ten_seconds_at_most(stuck):
    assert stuck.process.wait(10.0) == 0


def test_a_second_signal_ends_it_at_once(stuck):
    stuck.process.send_signal(signal.SIGTERM)
    assert stuck.process.wait(2.0) == 1


def test_the_real_command(serve, tmp_path):
    """With the kernels compiled: scans give a pose and a map, which outlive kill -9; SIGTERM gives 0."""
    server = serve("--data-dir", tmp_path, command=REAL)
    with MappingClient(server.address) as client:
        client.wait_until_serving(280.0)
        client.create_session("a")
        for step in range(5):
            client.add_odometry("a", step * SECOND_NS, 0.3 * step, 0.0, 0.1 * step)
            client.add_scan(
                "a", step * SECOND_NS, np.full(181, 3.0), angle_min_rad=-np.pi / 2,
                angle_increment_rad=np.pi / 180, range_min_m=0.1, range_max_m=20.0,
            )  # fmt: skip
        pose, grid, trajectory = client.pose("a"), client.map("a"), client.trajectory("a")
    assert len(trajectory.poses) == 5
    assert (grid.cells > 50).any()
    assert ((grid.cells >= 0) & (grid.cells < 50)).any()
    server.process.kill()
    server.process.communicate()

    again = serve("--data-dir", tmp_path, command=REAL)
    with MappingClient(again.address) as client:
        client.wait_until_serving(280.0)
        assert client.pose("a") == pose
        np.testing.assert_array_equal(client.map("a").cells, grid.cells)
        np.testing.assert_array_equal(client.trajectory("a").poses, trajectory.poses)
    assert again.end()[0] == 0
