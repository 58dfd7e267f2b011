"""The command `gridwright`: its subcommands are the entry points in the group gridwright.commands."""

from importlib.metadata import EntryPoint, entry_points
from typing import Any, NoReturn

import click

_DISTRIBUTION = "gridwright"


class EntryPointGroup(click.Group):
    """Loads a command when it is asked for, so that each part of the distribution adds its own.

    A command of the package gridwright_<extra> whose imports fail says which extra to install; the
    others work on.
    """

    def list_commands(self, ctx: click.Context) -> list[str]:
        """The commands' names, sorted."""
        return sorted(_entry_points())

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """The command, or one that tells what it misses."""
        entry_point = _entry_points().get(cmd_name)
        if entry_point is None:
            return None
        try:
            command = entry_point.load()
        except ModuleNotFoundError as error:
            return _command_missing(cmd_name, error)
        assert isinstance(command, click.Command)
        return command

    def invoke(self, ctx: click.Context) -> Any:
        """Runs the command; a module that it lacks becomes advice."""
        try:
            return super().invoke(ctx)
        except ModuleNotFoundError as error:
            raise click.ClickException(_advice(ctx.invoked_subcommand or "", error)) from error


def _entry_points() -> dict[str, EntryPoint]:
    return {entry_point.name: entry_point for entry_point in entry_points(group="gridwright.commands")}


def _command_missing(name: str, error: ModuleNotFoundError) -> click.Command:
    def fail(**_: object) -> NoReturn:
        raise error

    return click.Command(
        name,
        callback=fail,
        short_help=f"(not installed: {_advice(name, error)})",
        context_settings={"ignore_unknown_options": True, "allow_extra_args": True},
        add_help_option=False,
    )


def _advice(name: str, error: ModuleNotFoundError) -> str:
    package = _entry_points()[name].module.partition(".")[0]
    extra = package.removeprefix("gridwright_")
    requirement = _DISTRIBUTION if extra == "client" else f"{_DISTRIBUTION}[{extra}]"
    return f"the module {error.name} is missing: pip install '{requirement}'"


@click.group(cls=EntryPointGroup, name=_DISTRIBUTION)
@click.version_option(package_name=_DISTRIBUTION, prog_name=_DISTRIBUTION)
def main() -> None:
    """Gridwright: a mapping server for mobile robots."""
