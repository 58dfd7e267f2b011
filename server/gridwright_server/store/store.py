"""The data directory: one journal per session, locked against a second server."""

import fcntl
import logging
import os
from pathlib import Path

from gridwright_server.store.journal import Journal, JournalReader

_logger = logging.getLogger(__name__)


class StoreLockedError(Exception):
    """Another server works in the data directory."""


class Store:
    """Journals by session id, which must be fit for a file name."""

    def __init__(self, directory: Path) -> None:
        """Makes the directory where it is missing; OSError where it cannot be written."""
        directory.mkdir(parents=True, exist_ok=True)
        self._directory = directory
        self._lock = os.open(directory / "lock", os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
        try:
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            os.close(self._lock)
            raise StoreLockedError(f"another server works in {directory}") from error

    def create(self, session_id: str, created: bytes) -> Journal:
        """A new session's journal; FileExistsError where one is kept under this id."""
        return Journal.create(self._path(session_id), created)

    def session_ids(self) -> list[str]:
        """Every session that has a journal, sorted."""
        return sorted(path.stem for path in self._directory.glob("*.journal"))

    def read(self, session_id: str) -> JournalReader:
        """What is kept of the session; JournalRefusedError where the file is not understood."""
        return JournalReader(self._path(session_id))

    def resume(self, session_id: str, end: int) -> Journal:
        """Goes on after byte `end`, cutting off a torn record behind it."""
        path = self._path(session_id)
        torn_bytes = path.stat().st_size - end
        if torn_bytes:
            os.truncate(path, end)
            _logger.warning("session %s: cut off a torn record of %d bytes", session_id, torn_bytes)
        return Journal.reopen(path)

    def close(self) -> None:
        """Lets the next server in."""
        os.close(self._lock)

    def _path(self, session_id: str) -> Path:
        return self._directory / f"{session_id}.journal"
