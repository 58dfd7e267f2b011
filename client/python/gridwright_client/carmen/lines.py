"""The lines of a log file, plain or gzip, as far as they can be had."""

import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

_GZIP_MAGIC = b"\x1f\x8b"
_GZIP_WINDOW_BITS = 31  # zlib's code for: expect a gzip header
_CHUNK_BYTES = 1 << 16


@dataclass(frozen=True)
class LogText:
    """A log's bytes, and what kept the rest of the file from being read."""

    content: bytes
    damage: str | None

    def lines(self) -> Iterator[tuple[int, bytes]]:
        """Numbers from 1, and lines without their ends."""
        return enumerate(self.content.splitlines(), start=1)


def read_text(path: Path) -> LogText:
    """The file's text; a damaged gzip file gives what comes before the damage."""
    raw = path.read_bytes()
    return _decompressed(raw) if raw.startswith(_GZIP_MAGIC) else LogText(raw, None)


def _decompressed(raw: bytes) -> LogText:
    pieces: list[bytes] = []
    rest = raw
    while rest.startswith(_GZIP_MAGIC):  # a gzip file may have several members
        member = zlib.decompressobj(_GZIP_WINDOW_BITS)
        start = 0
        try:
            while not member.eof and start < len(rest):
                # In pieces: what a call had decompressed before it met an error is lost.
                pieces.append(member.decompress(rest[start : start + _CHUNK_BYTES]))
                start += _CHUNK_BYTES
        except zlib.error as error:
            return LogText(b"".join(pieces), f"the gzip data are damaged from here on ({error})")
        if not member.eof:
            return LogText(b"".join(pieces), "the gzip file ends too early")
        rest = member.unused_data + rest[start:]
    return LogText(b"".join(pieces), None)
