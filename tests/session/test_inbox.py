"""The inbox's promises, without a session around it."""

import threading

import pytest
from gridwright_server.errors import UnavailableError
from gridwright_server.session.inbox import QUEUE_LIMIT, Inbox


def closed():
    return UnavailableError("CLOSED", "closed")


def refused():
    return UnavailableError("REFUSED", "refused")


def test_entries_come_in_order_and_calls_before_them():
    inbox = Inbox()
    for entry in ("a", "b"):
        inbox.put(entry)
    inbox.put_call(len)
    assert [inbox.take() for _ in range(3)] == [len, "a", "b"]


def test_put_waits_for_room_and_drops_nothing():
    inbox = Inbox()
    for entry in range(QUEUE_LIMIT):
        inbox.put(entry)
    returned = threading.Event()

    def put_one_more():
        inbox.put(QUEUE_LIMIT)
        returned.set()

    thread = threading.Thread(target=put_one_more)
    thread.start()
    assert not returned.wait(0.1)
    taken = [inbox.take()]
    assert returned.wait(10.0)
    taken += [inbox.take() for _ in range(QUEUE_LIMIT)]
    assert taken == list(range(QUEUE_LIMIT + 1))
    thread.join()


def test_a_waiting_put_is_woken_by_refusal():
    inbox = Inbox()
    for entry in range(QUEUE_LIMIT):
        inbox.put(entry)
    errors = []

    def put_one_more():
        try:
            inbox.put(QUEUE_LIMIT)
        except UnavailableError as error:
            errors.append(error.reason)

    thread = threading.Thread(target=put_one_more)
    thread.start()
    assert inbox.refuse(refused) == list(range(QUEUE_LIMIT))
    thread.join(10.0)
    assert errors == ["REFUSED"]


def test_the_last_entry_passes_a_full_queue_and_ends_it():
    inbox = Inbox()
    for entry in range(QUEUE_LIMIT):
        inbox.put(entry)
    inbox.put_last("last", refused)
    with pytest.raises(UnavailableError, match="refused"):
        inbox.put("late")
    assert [inbox.take() for _ in range(QUEUE_LIMIT + 1)][-1] == "last"


def test_closing_answers_waiting_calls_but_no_entries():
    inbox = Inbox()
    inbox.put("entry")
    inbox.put_call(len)
    inbox.close(closed)
    assert inbox.take() is len
    assert inbox.take() is None
    for late in (inbox.put, inbox.put_call):
        with pytest.raises(UnavailableError, match="closed"):
            late("late")
    assert inbox.refuse(closed) == ["entry"]


def test_closing_wakes_the_taker():
    inbox = Inbox()
    taken = []
    thread = threading.Thread(target=lambda: taken.append(inbox.take()))
    thread.start()
    inbox.close(closed)
    thread.join(10.0)
    assert taken == [None]
