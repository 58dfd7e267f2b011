"""A session's inbox: a bounded queue of entries and a mailbox of calls that go first."""

import threading
from collections import deque
from collections.abc import Callable
from typing import Generic, TypeVar

from gridwright_server.errors import GridwrightError

QUEUE_LIMIT = 256

_Entry = TypeVar("_Entry")
Call = Callable[[], None]
Refusal = Callable[[], GridwrightError]
"""Makes the error that a latecomer gets; one each, for an exception gathers the traces it is raised on."""


class Inbox(Generic[_Entry]):
    """Filled by any thread, emptied by one.

    Open at first; `refuse` ends the taking of entries, `close` also that of calls and the work on
    what is queued.
    """

    def __init__(self) -> None:
        self._entries: deque[_Entry] = deque()
        self._calls: deque[Call] = deque()
        self._refusal: Refusal | None = None
        self._closing: Refusal | None = None
        lock = threading.Lock()
        self._work = threading.Condition(lock)
        self._room = threading.Condition(lock)

    def check_open(self) -> None:
        """Raises what a `put` would raise."""
        if self._refusal is not None:
            raise self._refusal()

    def put(self, entry: _Entry) -> None:
        """Waits for room: nothing is ever dropped to make some."""
        with self._room:
            while len(self._entries) >= QUEUE_LIMIT and self._refusal is None:
                self._room.wait()
            self.check_open()
            self._entries.append(entry)
            self._work.notify()

    def put_last(self, entry: _Entry, refusal: Refusal) -> None:
        """Queues a final entry, even where there is no room, and refuses those that come later."""
        with self._work:
            if self._closing is not None:
                raise self._closing()
            self._entries.append(entry)
            if self._refusal is None:
                self._refuse(refusal)
            self._work.notify()

    def refuse(self, refusal: Refusal) -> list[_Entry]:
        """Takes no more entries and hands out those that were waiting; calls go on."""
        with self._work:
            self._refuse(refusal)
            waiting = list(self._entries)
            self._entries.clear()
            return waiting

    def put_call(self, call: Call) -> None:
        """Queues a call; they are taken before entries, in their order."""
        with self._work:
            if self._closing is not None:
                raise self._closing()
            self._calls.append(call)
            self._work.notify()

    def close(self, refusal: Refusal) -> None:
        """Makes `take` end once the calls in the mailbox are done."""
        with self._work:
            if self._closing is None:
                self._closing = refusal
                self._refuse(refusal)
                self._work.notify()

    def take(self) -> Call | _Entry | None:
        """Waits for the next call or entry; None when closed."""
        with self._work:
            while not (self._calls or self._entries or self._closing):
                self._work.wait()
            if self._calls:
                return self._calls.popleft()
            if self._closing is not None:
                return None
            self._room.notify()
            return self._entries.popleft()

    def _refuse(self, refusal: Refusal) -> None:
        self._refusal = refusal
        self._room.notify_all()
