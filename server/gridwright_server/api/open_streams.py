"""The open streams of sensor data: their limit, and their end when the server stops."""

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from gridwright_server.errors import GridwrightError, ResourceExhaustedError
from gridwright_server.session.registry import stopping_error

End = Callable[[GridwrightError], None]


class StreamSlot:
    """One open stream's place."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._stopped = False
        self._end: End | None = None

    def on_server_stop(self, end: End) -> None:
        """Calls `end` with the stream's last error when the server stops, or now if it has."""
        with self._lock:
            self._end = end
            stopped = self._stopped
        if stopped:
            end(stopping_error())

    def stop(self) -> None:
        """Ends the stream in the slot."""
        with self._lock:
            self._stopped = True
            end = self._end
        if end is not None:
            end(stopping_error())


class OpenStreams:
    """At most `limit` streams at a time, for each holds a thread of the server's pool."""

    def __init__(self, limit: int) -> None:
        self._limit = limit
        self._lock = threading.Lock()
        self._slots: set[StreamSlot] = set()

    @contextmanager
    def slot(self) -> Iterator[StreamSlot]:
        """Occupies a slot; ResourceExhaustedError where none is free."""
        slot = StreamSlot()
        with self._lock:
            if len(self._slots) >= self._limit:
                raise ResourceExhaustedError(
                    "TOO_MANY_STREAMS",
                    f"{self._limit} streams are open: close one first",
                    limit=self._limit,
                )
            self._slots.add(slot)
        try:
            yield slot
        finally:
            with self._lock:
                self._slots.discard(slot)

    def stop(self) -> None:
        """Ends every open stream with UNAVAILABLE."""
        with self._lock:
            slots = list(self._slots)
        for slot in slots:
            slot.stop()
