"""How much of a log is under way to the server at a time."""

import threading

_ITEMS = 512
_CHECK_S = 0.1


class SendingWindow:
    """Lets a sender run ahead of the answers by a bounded number of items.

    gRPC itself would take in thousands of scans: an interrupt would have to wait for all of them.
    A few batches under way are enough to keep the server busy.
    """

    def __init__(self, stop: threading.Event) -> None:
        """Once `stop` is set nothing more is sent."""
        self._stop = stop
        self._closed = threading.Event()
        self._room = threading.Semaphore(_ITEMS)

    @property
    def is_open(self) -> bool:
        """False once nothing more is to be sent."""
        return not (self._stop.is_set() or self._closed.is_set())

    def take(self) -> bool:
        """Waits until one more item may be sent; False if none ever may."""
        while self.is_open:
            if self._room.acquire(timeout=_CHECK_S):
                return True
        return False

    def sleep(self, duration_s: float) -> None:
        """Sleeps, not much longer than the window is open."""
        self._stop.wait(min(duration_s, _CHECK_S))

    def answered(self) -> None:
        """An item's answer has come: another one may be sent."""
        self._room.release()

    def close(self) -> None:
        """No answers will come any more: lets the sender's thread end."""
        self._closed.set()
