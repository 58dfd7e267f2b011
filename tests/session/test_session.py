"""A session without a wire: what is delivered to whom."""

import threading
from concurrent.futures import Future

import numpy as np
import pytest
from fake_mapper import FakeMapper
from gridwright_server.config import MapperConfig
from gridwright_server.errors import FailedPreconditionError, GridwrightError, UnavailableError
from gridwright_server.session.items import OdometryReading, SensorItem, SessionSpec
from gridwright_server.session.session import Session, SessionState
from gridwright_server.slam.types import Scan, Verdict


def stopping():
    return UnavailableError("STOPPING", "stopping")


def odometry(number=None):
    return SensorItem(OdometryReading(1, np.zeros(3)), None, number)


def scan(number=None):
    data = Scan(2, np.zeros(1), np.ones(1), 0.1, 10.0, np.zeros(3))
    return SensorItem(data, None, number)


def submit(session, item):
    future = Future()

    def deliver(outcome):
        if isinstance(outcome, GridwrightError):
            future.set_exception(outcome)
        else:
            future.set_result(outcome)

    session.submit(item, deliver)
    return future


@pytest.fixture
def mapper():
    return FakeMapper()


@pytest.fixture
def session(mapper):
    session = Session(SessionSpec("a", 0, MapperConfig(), 0, {"laser": np.zeros(3)}), mapper)
    session.start()
    yield session
    mapper.release()
    session.close(stopping)


def test_outcomes_and_counts(session):
    outcomes = [submit(session, item) for item in (scan(), odometry(1), scan(2), odometry(1))]
    verdicts = [outcome.result(10.0).verdict for outcome in outcomes]
    assert verdicts == [
        Verdict.REJECTED_NO_ODOMETRY,
        Verdict.PROCESSED,
        Verdict.PROCESSED,
        Verdict.DUPLICATE,
    ]
    counts = session.counts
    assert (counts.rejected_no_odometry, counts.odometry_processed, counts.scans_processed) == (1, 1, 1)
    assert counts.duplicates == 1
    assert session.latest is outcomes[2].result().estimate


def test_a_gap_queues_nothing_and_uses_no_number(session):
    with pytest.raises(FailedPreconditionError) as caught:
        submit(session, odometry(2))
    assert caught.value.metadata == {"expected_sequence_number": "1", "received_sequence_number": "2"}
    assert submit(session, odometry(1)).result(10.0).verdict is Verdict.PROCESSED


def test_calls_run_on_the_writer_thread_and_pass_errors_on(session):
    assert session.call(lambda mapper: threading.current_thread().name) == "session-a"
    with pytest.raises(ZeroDivisionError):
        session.call(lambda mapper: 1 / 0)
    assert session.state is SessionState.ACTIVE


def test_close_refuses_what_waits(session, mapper):
    mapper.hold()
    at_hand = submit(session, scan())
    assert mapper.entered.wait(10.0)
    waiting = submit(session, scan())
    closing = threading.Thread(target=session.close, args=(stopping,))
    closing.start()
    poll = threading.Event()
    while session._inbox._closing is None:
        poll.wait(0.005)
    with pytest.raises(UnavailableError):
        submit(session, scan())
    mapper.release()
    closing.join(10.0)
    assert at_hand.result(10.0)
    with pytest.raises(UnavailableError):
        waiting.result(10.0)
    with pytest.raises(UnavailableError):
        session.finish()


def test_finishing_from_several_threads(session):
    submit(session, odometry())
    threads = [threading.Thread(target=session.finish) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(10.0)
    assert session.state is SessionState.FINISHED
    session.finish()
