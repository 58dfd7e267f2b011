"""The sessions of this server, by id."""

import bisect
import logging
import threading
from collections.abc import Callable
from typing import Protocol

from gridwright_server.config import MapperConfig
from gridwright_server.errors import (
    AlreadyExistsError,
    GridwrightError,
    NotFoundError,
    ResourceExhaustedError,
    UnavailableError,
)
from gridwright_server.session.items import MapperPort, SensorItem, SessionSpec
from gridwright_server.session.session import Session
from gridwright_server.store.journal import Journal, JournalReader, JournalRefusedError, RecordKind
from gridwright_server.store.store import Store

SESSION_LIMIT = 64

MakeMapper = Callable[[MapperConfig, int], MapperPort]
"""From configuration and seed."""

_logger = logging.getLogger(__name__)


class Codec(Protocol):
    """Between sessions and the bytes that their journals keep."""

    def encode_spec(self, spec: SessionSpec) -> bytes:
        """What a session is created with."""
        ...

    def decode_spec(self, payload: bytes) -> SessionSpec:
        """The reverse; ValueError or GridwrightError for what this server does not accept."""
        ...

    def decode_item(self, payload: bytes, spec: SessionSpec) -> SensorItem:
        """The reverse of SensorItem.record."""
        ...


class SessionRegistry:
    """Creates, finds, lists, deletes and, from a store, recovers sessions."""

    def __init__(self, make_mapper: MakeMapper, codec: Codec, store: Store | None = None) -> None:
        self._make_mapper = make_mapper
        self._codec = codec
        self._store = store
        self._sessions: dict[str, Session] = {}
        self._lock = threading.Lock()
        self._closed = False

    def create(self, spec: SessionSpec) -> Session:
        """Starts a session; its id must be free."""
        session_id = spec.session_id
        with self._lock:
            self._check_open()
            if session_id in self._sessions:
                raise _taken(session_id)
            if len(self._sessions) >= SESSION_LIMIT:
                raise ResourceExhaustedError(
                    "TOO_MANY_SESSIONS",
                    f"the server holds {SESSION_LIMIT} sessions: delete one first",
                    limit=SESSION_LIMIT,
                )
            session = Session(spec, self._make_mapper(spec.config, spec.seed))
            session.start(self._new_journal(spec))
            self._sessions[session_id] = session
        _logger.info("session %s created", session_id)
        return session

    def get(self, session_id: str) -> Session:
        """The session; NotFoundError if there is none."""
        session = self._sessions.get(session_id)
        if session is None:
            raise NotFoundError(
                "SESSION_NOT_FOUND", f"there is no session {session_id}", session_id=session_id
            )
        return session

    def page(self, after: str, size: int) -> tuple[list[Session], bool]:
        """Up to `size` sessions with ids above `after`, by id, and whether there are more."""
        with self._lock:
            ids = sorted(self._sessions)
            start = bisect.bisect_right(ids, after)
            chosen = ids[start : start + size]
            return [self._sessions[session_id] for session_id in chosen], start + size < len(ids)

    def delete(self, session_id: str) -> None:
        """Ends the session and drops what is stored of it."""
        with self._lock:
            session = self.get(session_id)
            session.delete()
            del self._sessions[session_id]
        _logger.info("session %s deleted", session_id)

    def recover(self) -> None:
        """Maps again what the store keeps; a session that cannot be trusted is left out, its file alone."""
        for session_id in self._store.session_ids() if self._store else ():
            try:
                self._recover(session_id)
            except UnavailableError:
                return  # the server is told to stop
            except (JournalRefusedError, GridwrightError, ValueError) as error:
                _logger.error("session %s is refused, its journal left as it is: %s", session_id, error)

    def close(self) -> None:
        """Ends every session and takes no more."""
        with self._lock:
            self._closed = True
            for session in self._sessions.values():
                session.stop(stopping_error)
            for session in self._sessions.values():
                session.close(stopping_error)
            if self._store is not None:
                self._store.close()

    def _recover(self, session_id: str) -> None:
        assert self._store is not None
        with self._store.read(session_id) as journal:
            session = self._replayed(session_id, journal)
            with self._lock:
                self._check_open()
                session.start(self._store.resume(session_id, journal.end))
                self._sessions[session_id] = session
        _logger.info("session %s recovered with %s", session_id, session.counts)

    def _replayed(self, session_id: str, journal: JournalReader) -> Session:
        records = iter(journal)
        created = next(records, None)
        if created is None or created.kind is not RecordKind.CREATED:
            raise JournalRefusedError("it does not begin with the session's creation")
        spec = self._codec.decode_spec(created.payload)
        if spec.session_id != session_id:
            raise JournalRefusedError(f"it is the journal of session {spec.session_id}")
        session = Session(spec, self._make_mapper(spec.config, spec.seed))
        for record in records:
            self._check_open()
            if record.kind is RecordKind.ITEM:
                session.replay(self._codec.decode_item(record.payload, spec))
            else:
                session.replay_finish()
        return session

    def _new_journal(self, spec: SessionSpec) -> Journal | None:
        if self._store is None:
            return None
        try:
            return self._store.create(spec.session_id, self._codec.encode_spec(spec))
        except FileExistsError as error:
            raise _taken(spec.session_id) from error

    def _check_open(self) -> None:
        if self._closed:
            raise stopping_error()


def _taken(session_id: str) -> GridwrightError:
    return AlreadyExistsError(
        "SESSION_EXISTS", f"the session id {session_id} is taken: choose another", session_id=session_id
    )


def stopping_error() -> GridwrightError:
    """What calls meet while the server stops."""
    return UnavailableError("SERVER_STOPPING", "the server is stopping: try again when it is back")
