"""One StreamSensorData call: a thread reads and queues items while the handler sends verdicts.

Reader -> session's queue -> writer thread -> outbox -> handler. The reader takes up batch after
batch without waiting for verdicts, up to a limit that bounds the outbox: a client that sends but
does not read comes to a halt, and holds up nobody else.
"""

import threading
from collections import deque
from collections.abc import Iterator

import grpc
from gridwright.v1 import mapping_service_pb2 as pb

from gridwright_server.api.convert.results import item_verdict
from gridwright_server.api.convert.sensor import LARGEST_BATCH, batch_of, stream_item
from gridwright_server.errors import GridwrightError
from gridwright_server.session.items import Outcome
from gridwright_server.session.session import Session

_MOST_UNANSWERED = 2 * LARGEST_BATCH


class _AbandonedError(Exception):
    """The client is gone."""


class SensorStream:
    """Feeds one session from one client.

    Ends when the client has sent all and every verdict is delivered; or with an error, after the
    verdicts of the items before it; or, when the client is gone, silently: what the session's queue
    has taken up by then is processed all the same, and the client will be told where to go on.
    """

    def __init__(
        self, session: Session, requests: Iterator[pb.StreamSensorDataRequest], want_poses: bool
    ) -> None:
        self._session = session
        self._requests = requests
        self._want_poses = want_poses
        self._outbox: deque[Outcome] = deque()
        self._unanswered = 0
        self._sent_all = False
        self._ended = False
        self._error: Exception | None = None
        self._changed = threading.Condition()

    def responses(self) -> Iterator[pb.StreamSensorDataResponse]:
        """Ready, then the verdicts as they come; raises what ended the stream."""
        next_number = self._session.next_sequence_number
        yield pb.StreamSensorDataResponse(ready=pb.StreamReady(next_sequence_number=next_number))
        threading.Thread(target=self._read, name="sensor-stream", daemon=True).start()
        while outcomes := self._take():
            verdicts = [item_verdict(outcome, self._want_poses) for outcome in outcomes]
            yield pb.StreamSensorDataResponse(verdicts=pb.VerdictBatch(verdicts=verdicts))
        if self._error is not None:
            raise self._error

    def end(self, error: Exception) -> None:
        """Ends the stream once the verdicts that are there have been sent; the first error counts."""
        with self._changed:
            self._error = self._error or error
            self._ended = True
            self._changed.notify_all()

    def abandon(self) -> None:
        """Ends the stream: nobody is there to read."""
        with self._changed:
            self._ended = True
            self._changed.notify_all()

    def _read(self) -> None:
        try:
            for request in self._requests:
                for message in batch_of(request).items:
                    self._submit(message)
        except (grpc.RpcError, _AbandonedError):
            self.abandon()
        except Exception as error:  # raised by `responses`, after the verdicts that are still to come
            self._error = self._error or error
        with self._changed:
            self._sent_all = True
            self._changed.notify_all()

    def _submit(self, message: pb.SensorItem) -> None:
        with self._changed:
            while self._unanswered >= _MOST_UNANSWERED and not self._ended:
                self._changed.wait()
        if self._error is not None:
            raise self._error
        if self._ended:
            raise _AbandonedError
        item = stream_item(message, self._session.spec.base_from_laser)
        self._session.submit(item, self._deliver)
        with self._changed:
            self._unanswered += 1

    def _deliver(self, outcome: Outcome | GridwrightError) -> None:
        if isinstance(outcome, GridwrightError):
            self.end(outcome)
            return
        with self._changed:
            self._outbox.append(outcome)
            self._changed.notify_all()

    def _take(self) -> list[Outcome]:
        """Waits for outcomes; none at the stream's end."""
        with self._changed:
            while not (self._outbox or self._ended or (self._sent_all and self._unanswered == 0)):
                self._changed.wait()
            count = min(len(self._outbox), LARGEST_BATCH)
            self._unanswered -= count
            self._changed.notify_all()
            return [self._outbox.popleft() for _ in range(count)]
