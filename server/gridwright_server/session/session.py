"""A session: one thread owns the mapper and works through a bounded queue of sensor items."""

import logging
import threading
import uuid
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass
from enum import Enum, auto
from typing import TypeVar

from gridwright_server.errors import FailedPreconditionError, GridwrightError, NotFoundError
from gridwright_server.session.inbox import Inbox, Refusal
from gridwright_server.session.items import (
    Deliver,
    Duplicate,
    InvalidData,
    MapperPort,
    OdometryReading,
    Outcome,
    SensorItem,
    SessionCounts,
    SessionSpec,
)
from gridwright_server.slam.types import PoseEstimate, Scan, Verdict
from gridwright_server.store.journal import Journal, RecordKind

_logger = logging.getLogger(__name__)
_T = TypeVar("_T")


class SessionState(Enum):
    """Names as in gridwright.v1.SessionState."""

    ACTIVE = auto()
    FINISHED = auto()
    FAILED = auto()


@dataclass(frozen=True)
class _Entry:
    """An item and who waits for its outcome; no item = the end of the session's data."""

    item: SensorItem | None
    deliver: Deliver


class Session:
    """One robot's run.

    Any thread may submit items, call and finish. `state`, `counts` and `latest` are replaced, never
    changed, by the writer thread, so they are read without a lock. Sequence numbers are checked as
    items are queued, so they hold also where two streams feed one session.
    """

    def __init__(self, spec: SessionSpec, mapper: MapperPort) -> None:
        self.spec = spec
        self.map_uid = str(uuid.uuid4())
        self.state = SessionState.ACTIVE
        self.counts = SessionCounts()
        self.latest: PoseEstimate | None = None
        self._mapper = mapper
        self._journal: Journal | None = None
        self._next_sequence_number = 1
        self._numbering = threading.Lock()
        self._inbox: Inbox[_Entry] = Inbox()
        self._incident = ""
        self._thread = threading.Thread(target=self._run, name=f"session-{spec.session_id}", daemon=True)

    @property
    def next_sequence_number(self) -> int:
        """The number that the next item of a stream must bear."""
        return self._next_sequence_number

    def start(self, journal: Journal | None = None) -> None:
        """Begins to work through the queue, keeping a journal if one is given."""
        self._journal = journal
        self._thread.start()

    def replay(self, item: SensorItem) -> None:
        """Takes up an item of the journal again; only before `start`."""
        self._process(_Entry(self._numbered(item), lambda _: None))

    def replay_finish(self) -> None:
        """Takes up the end of the journal again; only before `start`."""
        self._inbox.refuse(self._finished_error)
        self._process(_Entry(None, lambda _: None))

    def submit(self, item: SensorItem, deliver: Deliver) -> None:
        """Queues the item, waiting for room; its outcome or error goes to `deliver`.

        Raises, and queues nothing, where the session takes no more data or the sequence number
        leaves a gap.
        """
        with self._numbering:
            self._inbox.check_open()
            self._inbox.put(_Entry(self._numbered(item), deliver))

    def call(self, function: Callable[[MapperPort], _T]) -> _T:
        """Has the writer thread run `function` on the mapper, before the items that are queued."""
        future: Future[_T] = Future()

        def run() -> None:
            try:
                future.set_result(function(self._mapper))
            except Exception as error:
                future.set_exception(error)

        self._inbox.put_call(run)
        return future.result()

    def finish(self) -> None:
        """Takes no more items and returns when those queued have been processed."""
        done: Future[None] = Future()

        def deliver(outcome: Outcome | GridwrightError) -> None:
            if isinstance(outcome, GridwrightError):
                done.set_exception(outcome)
            else:
                done.set_result(None)

        self._inbox.put_last(_Entry(None, deliver), self._finished_error)
        done.result()

    def stop(self, refusal: Refusal) -> None:
        """Lets the thread end after the item at hand; what is queued or comes later is refused."""
        self._inbox.close(refusal)

    def close(self, refusal: Refusal) -> None:
        """Stops, and waits until the thread has ended."""
        self.stop(refusal)
        if self._thread.ident is not None:  # it was started
            self._thread.join()
        for entry in self._inbox.refuse(refusal):
            entry.deliver(refusal())
        if self._journal is not None:
            self._journal.close()

    def delete(self) -> None:
        """Closes the session and removes its journal."""
        self.close(self._deleted_error)
        if self._journal is not None:
            self._journal.delete()

    def _run(self) -> None:
        while (work := self._inbox.take()) is not None:
            if isinstance(work, _Entry):
                self._process(work)
            else:
                work()

    def _numbered(self, item: SensorItem) -> SensorItem:
        """Counts the item's sequence number, or marks the item as a duplicate."""
        number, expected = item.sequence_number, self._next_sequence_number
        if number is None:
            return item
        if number > expected:
            raise FailedPreconditionError(
                "SEQUENCE_GAP",
                f"item {number} came where {expected} was expected: send on from {expected}",
                expected_sequence_number=expected,
                received_sequence_number=number,
            )
        if number < expected:
            return SensorItem(Duplicate(), record=None, sequence_number=number)
        self._next_sequence_number = expected + 1
        return item

    def _process(self, entry: _Entry) -> None:
        """Journals the item, applies it, answers, in this order: what was answered is kept."""
        if self.state is SessionState.FAILED:
            entry.deliver(self._failed_error())
            return
        try:
            self._keep(entry.item)
            outcome = self._apply(entry.item) if entry.item else self._end()
        except Exception:
            self._fail()
            entry.deliver(self._failed_error())
            return
        entry.deliver(outcome)

    def _keep(self, item: SensorItem | None) -> None:
        if self._journal is None:
            return
        if item is None:
            self._journal.append(RecordKind.FINISHED)
        elif item.record is not None:
            self._journal.append(RecordKind.ITEM, item.record())

    def _end(self) -> Outcome:
        self.state = SessionState.FINISHED
        return Outcome(Verdict.PROCESSED)

    def _apply(self, item: SensorItem) -> Outcome:
        data, number = item.data, item.sequence_number
        if isinstance(data, Scan):
            result = self._mapper.add_scan(data)
            outcome = Outcome(result.verdict, number, estimate=result.estimate)
            self.latest = result.estimate or self.latest
        elif isinstance(data, OdometryReading):
            outcome = Outcome(self._mapper.add_odometry(data.stamp_ns, data.odom_from_base), number)
        elif isinstance(data, InvalidData):
            outcome = Outcome(Verdict.REJECTED_INVALID, number, violations=data.violations)
        else:
            outcome = Outcome(Verdict.DUPLICATE, number)
        self.counts = self.counts.with_one_more(outcome.verdict, data)
        return outcome

    def _fail(self) -> None:
        """An error that is no business of the client's: the session keeps what it has, to be read."""
        self._incident = uuid.uuid4().hex[:12]
        _logger.exception("session %s failed, incident %s", self.spec.session_id, self._incident)
        self.state = SessionState.FAILED
        for entry in self._inbox.refuse(self._failed_error):
            entry.deliver(self._failed_error())

    def _finished_error(self) -> GridwrightError:
        return FailedPreconditionError(
            "SESSION_FINISHED", f"session {self.spec.session_id} is finished: create another one"
        )

    def _failed_error(self) -> GridwrightError:
        return FailedPreconditionError(
            "SESSION_FAILED",
            f"session {self.spec.session_id} met an internal error (incident {self._incident}) and takes no "
            "more data; its map and trajectory stay readable",
            incident=self._incident,
        )

    def _deleted_error(self) -> GridwrightError:
        return NotFoundError("SESSION_NOT_FOUND", f"session {self.spec.session_id} was deleted")
