"""`gridwright serve` with fake mappers.

FAKE_WARM_UP=never keeps it warming up, =fails ends that; FAKE_SCANS=never keeps every scan in the works.
"""

import functools
import os
import threading

from fake_mapper import FakeMapper
from gridwright_client.cli.main import main
from gridwright_server import app


def warm_up():
    if os.environ.get("FAKE_WARM_UP") == "never":
        threading.Event().wait()
    if os.environ.get("FAKE_WARM_UP") == "fails":
        raise RuntimeError("no compiler")


def mapper(*arguments):
    fake = FakeMapper(*arguments)
    if os.environ.get("FAKE_SCANS") == "never":
        fake.hold()
    return fake


app.start_server = functools.partial(app.start_server, mapper_factory=mapper, warm_up=warm_up)
main()
