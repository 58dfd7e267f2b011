"""What the server is at: warming up, serving or stopping."""

import threading

from gridwright_server.errors import UnavailableError
from gridwright_server.session.registry import stopping_error


class Lifecycle:
    """Moves from warming up to serving to stopping; each step is taken once, none back."""

    def __init__(self) -> None:
        self._serving = threading.Event()
        self._stopping = threading.Event()

    def serve(self) -> bool:
        """Takes calls from now on; False where the server has been told to stop."""
        self._serving.set()
        return not self._stopping.is_set()

    def stop(self) -> bool:
        """Takes no more calls; False where that was so already."""
        was_stopping = self._stopping.is_set()
        self._stopping.set()
        return not was_stopping

    def check_serving(self) -> None:
        """Raises UnavailableError unless the server is serving."""
        if self._stopping.is_set():
            raise stopping_error()
        if not self._serving.is_set():
            raise UnavailableError(
                "WARMING_UP", "the server is compiling its kernels and reading its journals: try again soon"
            )
