"""How far a replay is: a live bar on a terminal, now and then a line elsewhere."""

import math
import time
from types import TracebackType
from typing import Self

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn

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
            BarColumn(bar_width=12),
            TaskProgressColumn(),
            TextColumn("{task.description}"),
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
            self._console.print(f"{tally.scan_count}/{self._scan_count} scans  {text}")

    def _text(self, tally: Tally, wall_s: float) -> str:
        """Short enough for a terminal of 80 columns, beside a bar."""
        share = tally.scan_count / max(self._scan_count, 1)
        parts = [f"{tally.scan_count / wall_s:.0f} scans/s", f"{share * self._robot_s / wall_s:.0f}x"]
        if tally.newest is not None:
            pose, newest = tally.newest.pose, tally.newest
            parts.append(f"Neff {newest.effective_sample_size:.1f}/{newest.particle_count}")
            degrees = math.degrees(pose.theta_radians)
            parts.append(f"({pose.x_meters:.1f}, {pose.y_meters:.1f}) m {degrees:+.0f}°")
        return "  ".join(parts)
