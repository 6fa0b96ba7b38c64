"""Progress of long computations: rate and time left."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    ProgressColumn,
    Task,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.text import Text


class _Rate(ProgressColumn):
    def render(self, task: Task) -> Text:
        speed = task.finished_speed or task.speed
        return Text("" if speed is None else f"{speed:.1f}/s")


@contextmanager
def shown_progress(console: Console, unit: str) -> Iterator[Callable[[int, int, int], None]]:
    """A callback that takes finished, total and failed, shown as a bar with rate and time left."""
    columns = (
        TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), _Rate(),
        TimeElapsedColumn(), TextColumn("left"), TimeRemainingColumn(),
    )  # fmt: skip
    with Progress(*columns, console=console, speed_estimate_period=60.0) as progress:
        task = progress.add_task(unit, total=None)

        def tell(done: int, total: int, failed: int) -> None:
            text = f"{unit}, {failed} failed" if failed else unit
            if progress.tasks[0].total is None:  # what was there before is not this run's speed
                progress.reset(task, completed=done, total=total, description=text)
            else:
                progress.update(task, completed=done, total=total, description=text)

        yield tell
