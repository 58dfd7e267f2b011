"""The journal as a file: what is appended is read back, what is damaged is told from what is torn."""

import logging

import pytest
from gridwright_server.store.journal import JournalReader, JournalRefusedError, Record, RecordKind
from gridwright_server.store.store import Store, StoreLockedError

PAYLOADS = [b"first", b"", bytes(range(256)), b"last"]


@pytest.fixture
def store(tmp_path):
    store = Store(tmp_path)
    yield store
    store.close()


@pytest.fixture
def path(store, tmp_path):
    journal = store.create("a", b"created")
    for payload in PAYLOADS:
        journal.append(RecordKind.ITEM, payload)
    journal.append(RecordKind.FINISHED)
    journal.close()
    return tmp_path / "a.journal"


RECORDS = [
    Record(RecordKind.CREATED, b"created"),
    *(Record(RecordKind.ITEM, payload) for payload in PAYLOADS),
    Record(RecordKind.FINISHED, b""),
]


def read(path):
    with JournalReader(path) as reader:
        return list(reader), reader.end


def test_what_is_appended_is_read_back(path):
    assert read(path) == (RECORDS, path.stat().st_size)


def test_every_truncation_gives_whole_records_only(path):
    whole = path.read_bytes()
    for size in range(12, len(whole)):
        path.write_bytes(whole[:size])
        records, end = read(path)
        assert records == RECORDS[: len(records)]
        assert len(records) < len(RECORDS)
        assert end <= size
        path.write_bytes(whole[:end])
        assert read(path) == (records, end)


@pytest.mark.parametrize("size", range(12))
def test_a_file_without_its_header_is_refused(path, size):
    path.write_bytes(path.read_bytes()[:size])
    with pytest.raises(JournalRefusedError, match="not a journal of format 1"):
        read(path)


def test_every_flipped_bit_is_found(path):
    whole = path.read_bytes()
    for bit in range(8 * len(whole)):
        damaged = bytearray(whole)
        damaged[bit // 8] ^= 1 << bit % 8
        path.write_bytes(damaged)
        with pytest.raises(JournalRefusedError):
            read(path)


def test_a_torn_record_is_cut_off_before_going_on(store, path, caplog):
    whole = path.read_bytes()
    path.write_bytes(whole[:-3])
    _, end = read(path)
    with caplog.at_level(logging.WARNING):
        journal = store.resume("a", end)
    assert "cut off a torn record of 10 bytes" in caplog.text
    journal.append(RecordKind.FINISHED)
    journal.close()
    assert path.read_bytes() == whole


def test_an_existing_journal_is_never_overwritten(store, path):
    before = path.read_bytes()
    with pytest.raises(FileExistsError):
        store.create("a", b"another")
    assert path.read_bytes() == before
    assert store.session_ids() == ["a"]


def test_a_short_write_is_completed(store, monkeypatch, tmp_path):
    import os

    real_write = os.write
    monkeypatch.setattr(os, "write", lambda descriptor, data: real_write(descriptor, data[:3]))
    journal = store.create("b", b"created")
    journal.append(RecordKind.ITEM, b"payload")
    journal.close()
    assert read(tmp_path / "b.journal")[0][1] == Record(RecordKind.ITEM, b"payload")


def test_delete_removes_the_file(store, path):
    journal = store.create("b", b"created")
    journal.delete()
    journal.delete()
    assert store.session_ids() == ["a"]


def test_a_second_server_is_locked_out(store, tmp_path):
    with pytest.raises(StoreLockedError, match="another server works in"):
        Store(tmp_path)


def test_the_lock_goes_with_its_holder(tmp_path):
    Store(tmp_path).close()
    Store(tmp_path).close()
