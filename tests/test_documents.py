"""What the documents say is so."""

import re
import subprocess
import sys
from dataclasses import fields, is_dataclass
from pathlib import Path

from gridwright_client.local_server import local_server
from gridwright_server.config import MapperConfig

ROOT = Path(__file__).parents[1]


def test_the_readme_has_at_most_150_lines():
    assert len((ROOT / "README.md").read_text().splitlines()) <= 150


def test_the_readmes_python_example_runs(capsys):
    (example,) = re.findall(r"```python\n(.*?)```", (ROOT / "README.md").read_text(), re.DOTALL)
    with local_server(threads=1) as address:
        exec(example.replace("127.0.0.1:50051", address), {})
    printed = capsys.readouterr().out
    assert "PoseEstimate" in printed or "x_meters" in printed or "pose" in printed
    assert re.search(r"\(\d+, \d+\)", printed)


def test_the_documents_name_every_setting_with_default_and_bounds():
    rows = re.findall(r"^\| `([a-z_.]+)` \| ([^|]+) \| ([^|]+) to ([^|]+) \|", _configuration(), re.MULTILINE)
    documented = {name: tuple(float(number) for number in numbers) for name, *numbers in rows}
    assert documented == dict(_settings(MapperConfig()))


def test_the_client_needs_no_numba():
    # A finder that refuses numba stands for an environment without it.
    program = """
import sys
class Absent:
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] in ("numba", "llvmlite", "gridwright_server"):
            raise ModuleNotFoundError(name, name=name)
sys.meta_path.insert(0, Absent())
import gridwright_client
from gridwright_client.cli import evaluate, replay, simulate
"""
    subprocess.run([sys.executable, "-c", program], check=True, timeout=60)


def _configuration() -> str:
    return (ROOT / "docs" / "configuration.md").read_text()


def _settings(stage, prefix=""):
    for entry in fields(stage):
        value = getattr(stage, entry.name)
        if is_dataclass(value):
            yield from _settings(value, f"{entry.name}.")
        else:
            low, high = entry.metadata["low"], entry.metadata["high"]
            yield prefix + entry.name, tuple(float(f"{number:g}") for number in (value, low, high))
