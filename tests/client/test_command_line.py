"""The command `gridwright` and how its parts come in."""

import functools
import subprocess
import sys
from importlib.metadata import EntryPoint

import pytest
from click.testing import CliRunner
from fake_mapper import FakeMapper
from gridwright_client import local_server
from gridwright_client.cli import main as cli
from gridwright_client.client import MappingClient
from gridwright_server import app
from gridwright_server.address import check


@pytest.fixture
def run():
    return lambda *arguments: CliRunner().invoke(cli.main, arguments)


def test_every_command_is_listed_without_loading_numba():
    code = (
        "import sys; from gridwright_client.cli.main import main\n"
        "try: main(['--help'])\n"
        "except SystemExit as end: assert not end.code\n"
        "assert 'numba' not in sys.modules"
    )
    result = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=60
    )
    for name in ("serve", "replay", "simulate", "evaluate"):
        assert name in result.stdout


def test_version(run):
    assert run("--version").output.startswith("gridwright, version ")


def test_unknown_commands(run):
    result = run("fly")
    assert result.exit_code == 2
    assert "No such command 'fly'" in result.output


def test_a_command_whose_package_is_missing_says_which_extra(run, monkeypatch):
    broken = EntryPoint("fly", "gridwright_wings.cli:fly", "gridwright.commands")
    monkeypatch.setattr(cli, "entry_points", lambda group: [broken])
    result = run("fly", "--high")
    assert result.exit_code == 1
    assert result.output == "Error: the module gridwright_wings is missing: pip install 'gridwright[wings]'\n"
    assert "not installed" in run("--help").output


def test_a_module_missed_while_running_is_advice_too(run, monkeypatch):
    monkeypatch.setitem(sys.modules, "gridwright_server.app", None)
    result = run("serve")
    assert result.exit_code == 1
    assert "pip install 'gridwright[server]'" in result.output


def test_a_local_server_without_the_server_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "gridwright_server.app", None)
    with (
        pytest.raises(local_server.ServerNotInstalledError, match=r"pip install 'gridwright\[server\]'"),
        local_server.local_server(),
    ):
        pass


def test_a_local_server_is_reachable_and_gone_afterwards(monkeypatch):
    fake = functools.partial(app.start_server, mapper_factory=FakeMapper, warm_up=lambda: None)
    monkeypatch.setattr(app, "start_server", fake)
    with local_server.local_server(threads=2) as address, MappingClient(address) as client:
        client.wait_until_serving(20.0)
        assert client.create_session("a").session_id == "a"
    check(address)
