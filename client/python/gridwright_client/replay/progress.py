"""How far a replay is: a live bar on a terminal, now and then a line elsewhere."""

import time
from types import TracebackType
from typing import Self

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn

from gridwright_client.replay.mapping import Tally

_REFRESH_S = 0.1
_LINE_EVERY_S = 5.0


class ReplayProgress:
    """Takes every answer, shows a few: formatting each would cost more than mapping it."""

    def __init__(self, console: Console, scan_count: int, robot_s: float) -> None:
        self._console = console
        self._scan_count = scan_count
        self._robot_s = robot_s
        self._started_s = time.monotonic()
        self._due_s = self._started_s + (_REFRESH_S if console.is_terminal else _LINE_EVERY_S)
        self._bar = Progress(
            BarColumn(bar_width=24),
            TaskProgressColumn(),
            TextColumn("{task.description}"),
            TimeRemainingColumn(compact=True),
            console=console,
            transient=True,
            disable=not console.is_terminal,
        )
        self._task = self._bar.add_task("waiting for the first scan", total=scan_count)

    def __enter__(self) -> Self:
        self._bar.start()
        return self

    def __exit__(
        self,
        exc_type: type[BaseException] | None,
        exc: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._bar.stop()

    def update(self, tally: Tally) -> None:
        """Call after each answer."""
        now_s = time.monotonic()
        if now_s < self._due_s:
            return
        text = self._text(tally, now_s - self._started_s)
        if self._console.is_terminal:
            self._due_s = now_s + _REFRESH_S
            self._bar.update(self._task, completed=tally.scan_count, description=text)
        else:
            self._due_s = now_s + _LINE_EVERY_S
            self._console.print(f"{tally.scan_count}/{self._scan_count} scans, {text}")

    def _text(self, tally: Tally, wall_s: float) -> str:
        share = tally.scan_count / max(self._scan_count, 1)
        parts = [
            f"{tally.scan_count / wall_s:.0f} scans/s",
            f"{share * self._robot_s / wall_s:.0f} x real time",
        ]
        if tally.newest is not None:
            pose, newest = tally.newest.pose, tally.newest
            parts.append(f"Neff {newest.effective_sample_size:.1f}/{newest.particle_count}")
            parts.append(f"at ({pose.x_meters:.2f}, {pose.y_meters:.2f}) m, {pose.theta_radians:+.2f} rad")
        return ", ".join(parts)
