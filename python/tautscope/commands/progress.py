"""Progress on stderr: a bar in a terminal, else lines of text."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn


@contextmanager
def progress_bar(title: str) -> Iterator[Callable[[float], None]]:
    """Yield a function to call with the share of work done, 0 to 1."""
    if not sys.stderr.isatty():
        yield _lines(title)
        return
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TaskProgressColumn(),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(title, total=1.0)
        yield lambda share: bar.update(task, completed=share)


def _lines(title: str) -> Callable[[float], None]:
    """Print a line at the start and at every 10 %."""
    printed = -1

    def report(share: float) -> None:
        nonlocal printed
        tenth = int(share * 10 + 1e-9)
        if tenth > printed:
            printed = tenth
            print(f"{title}: {10 * tenth} %", file=sys.stderr, flush=True)

    return report
