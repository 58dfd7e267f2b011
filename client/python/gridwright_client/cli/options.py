"""What the commands share: consoles, and errors in one line."""

from typing import NoReturn

import click
from rich.console import Console


class UserError(click.ClickException):
    """What the user can put right."""

    exit_code = 2


def console(*, stderr: bool = False) -> Console:
    """Plain text where the output is not a terminal, and no guessing at what a number may mean."""
    return Console(stderr=stderr, highlight=False, soft_wrap=True)


def fail(message: str) -> NoReturn:
    """Ends the command with one line that says what to do, and exit code 2."""
    raise UserError(message)


def os_error_text(error: OSError) -> str:
    """Which file could not be used, and why."""
    reason = error.strerror or str(error)
    return f"{error.filename}: {reason}" if error.filename else reason
