"""StreamSensorData: order, numbers, pipelining, and how streams end."""

import threading

import grpc
import pytest
from fake_mapper import BAD_STAMP_NS, SECRET
from gridwright.v1 import mapping_service_pb2 as pb
from gridwright.v1.sensor_pb2 import VERDICT_DUPLICATE, VERDICT_PROCESSED
from gridwright_client.errors import GridwrightRpcError
from gridwright_client.items import odometry, sensor_item
from gridwright_server import app
from gridwright_server.session.inbox import QUEUE_LIMIT
from support import Feed, drive, scan_message, until_error

DEADLINE_S = 20.0


@pytest.fixture
def session(fake_server):
    return fake_server.client.create_session("robot").session_id


def start(session_id="robot", want_poses=False):
    return pb.StreamSensorDataRequest(start=pb.StreamStart(session_id=session_id, want_poses=want_poses))


def batch(items):
    return pb.StreamSensorDataRequest(batch=pb.SensorBatch(items=items))


def verdicts_until(call, count):
    verdicts = []
    while len(verdicts) < count:
        verdicts.extend(next(call).verdicts.verdicts)
    return verdicts


def test_a_verdict_for_each_item_in_order(fake_server, session):
    verdicts = list(fake_server.client.stream(session, drive(3000), want_poses=True))
    assert [verdict.sequence_number for verdict in verdicts] == list(range(1, 3001))
    assert all(verdict.HasField("pose") == (verdict.sequence_number % 2 == 0) for verdict in verdicts)
    counts = fake_server.client.finish_session(session).counts
    assert (counts.odometry_processed, counts.scans_processed) == (1500, 1000)
    assert counts.scans_skipped_below_motion_threshold == 500


def test_no_poses_unless_asked_for(fake_server, session):
    verdicts = list(fake_server.client.stream(session, drive(4)))
    assert not any(verdict.HasField("pose") for verdict in verdicts)


def test_later_batches_are_taken_up_before_earlier_verdicts(fake_server, session, feed):
    [mapper] = fake_server.mappers
    mapper.hold()
    call = fake_server.mapping.StreamSensorData(feed, timeout=DEADLINE_S)
    feed.put(start())
    items = list(drive(8))
    for item in items:
        feed.put(batch([item]))
    assert next(call).ready.next_sequence_number == 1
    assert verdicts_until(call, 1)[0].sequence_number == 1
    assert mapper.entered.wait(DEADLINE_S)
    watched = fake_server.server._parts.registry.get(session)
    poll = threading.Event()
    while watched.next_sequence_number < 9:
        poll.wait(0.005)
    mapper.release()
    feed.close()
    assert [verdict.sequence_number for verdict in verdicts_until(call, 7)] == list(range(2, 9))
    assert list(call) == []


def test_verdicts_come_while_the_client_is_silent(fake_server, session, feed):
    call = fake_server.mapping.StreamSensorData(feed, timeout=DEADLINE_S)
    feed.put(start())
    next(call)
    for number in range(1, 4):
        feed.put(batch([sensor_item(number, odometry(number, 0, 0, 0))]))
        assert verdicts_until(call, 1)[0].sequence_number == number


def test_duplicates_are_not_applied_again(fake_server, session):
    list(fake_server.client.stream(session, drive(4)))
    before = fake_server.client.pose(session)
    verdicts = list(fake_server.client.stream(session, [*drive(4), *drive(1, first=5)]))
    assert [verdict.verdict for verdict in verdicts] == [VERDICT_DUPLICATE] * 4 + [VERDICT_PROCESSED]
    assert fake_server.client.pose(session) == before
    assert fake_server.client.get_session(session).counts.duplicates == 4
    assert fake_server.client.next_sequence_number(session) == 6


def test_a_gap_is_named_after_the_verdicts_before_it(fake_server, session):
    items = [*drive(5), *drive(1, first=7)]
    verdicts, error = until_error(fake_server.client.stream(session, items))
    assert [verdict.sequence_number for verdict in verdicts] == [1, 2, 3, 4, 5]
    assert (error.code, error.reason) == (grpc.StatusCode.FAILED_PRECONDITION, "SEQUENCE_GAP")
    assert error.metadata["expected_sequence_number"] == "6"


def test_two_streams_of_the_same_items_apply_each_once(fake_server, session):
    answers = []

    def send():
        answers.extend(fake_server.client.stream(session, drive(2000), batch_size=16))

    threads = [threading.Thread(target=send) for _ in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    # A stream may run ahead of the other, but never past what the session has: no gaps, only duplicates.
    assert len(answers) == 4000
    assert sum(answer.verdict == VERDICT_DUPLICATE for answer in answers) == 2000
    assert fake_server.client.get_session(session).counts.odometry_processed == 1000


def test_unary_and_stream_mix(fake_server, session):
    list(fake_server.client.stream(session, drive(2)))
    fake_server.client.add_odometry(session, 5, 0.0, 0.0, 0.0)
    assert len(list(fake_server.client.stream(session, drive(2, first=3)))) == 2


def test_what_was_taken_up_is_processed_when_the_client_vanishes(fake_server, session, feed):
    [mapper] = fake_server.mappers
    mapper.hold()
    call = fake_server.mapping.StreamSensorData(feed, timeout=DEADLINE_S)
    feed.put(start())
    feed.put(batch(list(drive(QUEUE_LIMIT + 100))))
    next(call)
    assert mapper.entered.wait(DEADLINE_S)
    watched = fake_server.server._parts.registry.get(session)
    poll = threading.Event()
    while len(watched._inbox._entries) < QUEUE_LIMIT:
        poll.wait(0.005)
    call.cancel()
    feed.close()
    mapper.release()
    while fake_server.server._parts.streams._slots:
        poll.wait(0.005)
    while any(thread.name == "sensor-stream" for thread in threading.enumerate()):
        poll.wait(0.005)
    fake_server.client.finish_session(session)
    taken = watched.next_sequence_number - 1
    assert taken >= QUEUE_LIMIT
    assert watched.counts.odometry_processed + len(mapper.scans) == taken


def test_a_failing_items_source_is_the_clients_error(fake_server, session):
    def items():
        yield from drive(5)
        raise OSError("the log ended early")

    received, error = until_error(fake_server.client.stream(session, items()))
    assert len(received) == 5
    assert str(error) == "the log ended early"


def test_finished_and_unknown_sessions(fake_server, session):
    fake_server.client.finish_session(session)
    assert fake_server.client.finish_session(session).state == 2
    with pytest.raises(GridwrightRpcError) as caught:
        list(fake_server.client.stream(session, drive(1)))
    assert (caught.value.code, caught.value.reason) == (
        grpc.StatusCode.FAILED_PRECONDITION,
        "SESSION_FINISHED",
    )
    with pytest.raises(GridwrightRpcError) as caught:
        list(fake_server.client.stream("nobody", drive(1)))
    assert (caught.value.code, caught.value.reason) == (grpc.StatusCode.NOT_FOUND, "SESSION_NOT_FOUND")


def test_finish_drains_what_is_queued(fake_server, session, feed):
    [mapper] = fake_server.mappers
    mapper.hold()
    call = fake_server.mapping.StreamSensorData(feed, timeout=DEADLINE_S)
    feed.put(start())
    feed.put(batch(list(drive(20))))
    assert mapper.entered.wait(DEADLINE_S)
    watched = fake_server.server._parts.registry.get(session)
    poll = threading.Event()
    while watched.next_sequence_number < 21:
        poll.wait(0.005)
    finishing = threading.Thread(target=fake_server.client.finish_session, args=(session,))
    finishing.start()
    mapper.release()
    finishing.join()
    assert len(mapper.scans) == 10
    next(call)
    assert len(verdicts_until(call, 20)) == 20


def test_an_error_inside_fails_the_session_and_keeps_its_text(fake_server, session, caplog):
    items = [*drive(4), sensor_item(5, scan_message(BAD_STAMP_NS)), *drive(3, first=6)]
    received, error = until_error(fake_server.client.stream(session, items))
    assert [verdict.sequence_number for verdict in received] == [1, 2, 3, 4]
    assert error.reason == "SESSION_FAILED"
    assert SECRET not in str(error)
    assert error.metadata["incident"] in caplog.text
    assert SECRET in caplog.text
    assert fake_server.client.get_session(session).state == 3
    assert len(fake_server.client.trajectory(session).stamps_ns) == 2
    assert fake_server.client.map(session).cells.size
    with pytest.raises(GridwrightRpcError, match="SESSION_FAILED"):
        fake_server.client.add_odometry(session, 9, 0.0, 0.0, 0.0)
    with pytest.raises(GridwrightRpcError, match="SESSION_FAILED"):
        fake_server.client.finish_session(session)


def test_deleting_a_session_ends_its_stream(fake_server, session, feed):
    [mapper] = fake_server.mappers
    mapper.hold()
    call = fake_server.mapping.StreamSensorData(feed, timeout=DEADLINE_S)
    feed.put(start())
    feed.put(batch(list(drive(20))))
    assert mapper.entered.wait(DEADLINE_S)
    watched = fake_server.server._parts.registry.get(session)
    poll = threading.Event()
    while watched.next_sequence_number < 21:
        poll.wait(0.005)
    deleting = threading.Thread(target=fake_server.client.delete_session, args=(session,))
    deleting.start()
    while watched._inbox._closing is None:
        poll.wait(0.005)
    mapper.release()
    deleting.join()
    with pytest.raises(grpc.RpcError) as caught:
        list(call)
    assert caught.value.code() is grpc.StatusCode.NOT_FOUND
    assert len(mapper.scans) == 1


def test_one_stream_more_than_the_limit(fake_server, session, monkeypatch):
    assert app.STREAM_LIMIT == 128
    monkeypatch.setattr(fake_server.server._parts.streams, "_limit", 3)
    opened = []
    feeds = []
    for _ in range(3):
        feeds.append(Feed())
        feeds[-1].put(start())
        opened.append(fake_server.mapping.StreamSensorData(feeds[-1], timeout=DEADLINE_S))
        next(opened[-1])
    with pytest.raises(GridwrightRpcError) as caught:
        list(fake_server.client.stream(session, drive(1)))
    assert (caught.value.code, caught.value.reason) == (
        grpc.StatusCode.RESOURCE_EXHAUSTED,
        "TOO_MANY_STREAMS",
    )
    feeds[0].close()
    assert list(opened[0]) == []
    assert len(list(fake_server.client.stream(session, drive(1)))) == 1
    for feed in feeds:
        feed.close()


def test_a_client_that_does_not_read_holds_up_nobody_else(fake_server, session, feed):
    """It has its items taken up to the bound, and another session goes on."""
    fake_server.client.create_session("other")
    call = fake_server.mapping.StreamSensorData(feed, timeout=60.0)
    feed.put(start(want_poses=True))
    items = list(drive(40_000))
    for first in range(0, len(items), 1000):
        feed.put(batch(items[first : first + 1000]))
    assert len(list(fake_server.client.stream("other", drive(1000)))) == 1000
    feed.close()
    next(call)
    assert len(verdicts_until(call, 40_000)) == 40_000
