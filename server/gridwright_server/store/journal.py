"""The journal of one session: an append-only file of opaque records.

    file   = magic, format number, record*
    record = body length, CRC-32 of the body, CRC-32 of these two, body
    body   = kind (1 byte), payload

`append` returns once the operating system has the record: nothing appended is lost when the
process is killed. A loss of power may lose what the system had not yet written to the disk.
The CRC over the length tells a flipped bit, which makes the file unreadable, from a torn last
record, which was never acknowledged and may be cut off.
"""

import os
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from enum import IntEnum
from pathlib import Path
from types import TracebackType
from typing import Self

_MAGIC = b"GWJOURNL"
_FORMAT = 1
_FILE_HEADER = struct.Struct("<8sI")
_LENGTHS = struct.Struct("<II")
_RECORD_HEADER_BYTES = _LENGTHS.size + 4


class JournalRefusedError(Exception):
    """A journal that this server cannot trust or does not understand; the file is left as it is."""


class RecordKind(IntEnum):
    """What a record tells."""

    CREATED = 1
    ITEM = 2
    FINISHED = 3


@dataclass(frozen=True)
class Record:
    """One thing that happened to a session."""

    kind: RecordKind
    payload: bytes


class Journal:
    """The writing end; used by one thread at a time."""

    def __init__(self, path: Path, descriptor: int) -> None:
        self._path = path
        self._descriptor = descriptor

    @classmethod
    def create(cls, path: Path, created: bytes) -> Self:
        """A new file that begins with a CREATED record; FileExistsError if there is one."""
        unfinished = path.with_suffix(".new")  # a kill between open and write leaves no half journal
        header = _FILE_HEADER.pack(_MAGIC, _FORMAT)
        unfinished.write_bytes(header + _framed(RecordKind.CREATED, created))
        try:
            os.link(unfinished, path)
        finally:
            unfinished.unlink()
        return cls.reopen(path)

    @classmethod
    def reopen(cls, path: Path) -> Self:
        """Goes on at the end of an existing file."""
        return cls(path, os.open(path, os.O_WRONLY | os.O_APPEND | os.O_CLOEXEC))

    def append(self, kind: RecordKind, payload: bytes = b"") -> None:
        """Hands the record to the operating system."""
        rest = memoryview(_framed(kind, payload))
        while rest:  # a write may be short, as on a disk that is almost full
            rest = rest[os.write(self._descriptor, rest) :]

    def close(self) -> None:
        """Closing twice is harmless."""
        if self._descriptor >= 0:
            os.close(self._descriptor)
            self._descriptor = -1

    def delete(self) -> None:
        """Closes and removes the file."""
        self.close()
        self._path.unlink(missing_ok=True)


class JournalReader:
    """Reads a journal from its start; `end` is the offset after the last whole record."""

    def __init__(self, path: Path) -> None:
        self._file = path.open("rb")
        header = self._file.read(_FILE_HEADER.size)
        if header != _FILE_HEADER.pack(_MAGIC, _FORMAT):
            self._file.close()
            raise JournalRefusedError(f"not a journal of format {_FORMAT}")
        self.end = len(header)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        exc_type: type[BaseException] | None,
        exc: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._file.close()

    def __iter__(self) -> Iterator[Record]:
        """Yields whole records up to a torn one; raises JournalRefusedError at a corrupt one."""
        while len(header := self._file.read(_RECORD_HEADER_BYTES)) == _RECORD_HEADER_BYTES:
            length, body_crc = _LENGTHS.unpack_from(header)
            if header[_LENGTHS.size :] != _crc(header[: _LENGTHS.size]):
                raise JournalRefusedError(f"the record at byte {self.end} has a corrupt header")
            body = self._file.read(length)
            if len(body) < length:
                return
            if zlib.crc32(body) != body_crc or body[0] not in set(RecordKind):
                raise JournalRefusedError(f"the record at byte {self.end} is corrupt")
            self.end += _RECORD_HEADER_BYTES + length
            yield Record(RecordKind(body[0]), body[1:])


def _framed(kind: RecordKind, payload: bytes) -> bytes:
    body = bytes([kind]) + payload
    lengths = _LENGTHS.pack(len(body), zlib.crc32(body))
    return lengths + _crc(lengths) + body


def _crc(data: bytes) -> bytes:
    return struct.pack("<I", zlib.crc32(data))
