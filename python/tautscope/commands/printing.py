"""What commands print: text and tables, or with ``--json`` one object; progress on stderr."""

from __future__ import annotations

import argparse
import json
import shutil
import sys
from collections.abc import Callable, Container, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from tautscope.errors import OutputError

if TYPE_CHECKING:
    from rich.console import Console


def print_json(options: argparse.Namespace, document: dict[str, Any]) -> None:
    """With ``--json``, print a document in one line, at once; it must not contain NaN.

    `tautscope.cli` then prints nothing else on the standard output.
    """
    if options.json:
        print(json.dumps(document, allow_nan=False), file=options.stdout, flush=True)


def print_warnings(texts: Iterable[str]) -> None:
    """Print warnings on stderr, also with ``--json``."""
    for text in texts:
        print(f"warning: {text}.", file=sys.stderr)


def announce(what: str, seconds: float, size: float, folder: Path) -> None:
    """Print on stderr how long a command takes, and where it writes.

    Args:
        what: What runs.
        seconds: Estimated duration [s].
        size: Estimated, or largest size of the files [byte].
        folder: Where they will be.

    Raises:
        OutputError: The disk has no room for the files.
    """
    path = folder.absolute()
    above = next(each for each in (path, *path.parents) if each.exists())  # it may be a mount point
    free = shutil.disk_usage(above).free
    duration = f"{seconds:.0f} s" if seconds < 90 else f"{seconds / 60:.1f} min"
    unit, scale = ("MB", 1e6) if size < 1e9 else ("GB", 1e9)
    text = f"{what}: about {duration}, up to {size / scale:.2g} {unit} in {folder}"
    print(f"{text} ({free / 1e9:.0f} GB free)", file=sys.stderr, flush=True)
    if size > free:
        allowed = f"a folder with {size / scale:.2g} {unit} free: --out, or a shorter run"
        raise OutputError("out", f"{above} with {free / scale:.2g} {unit} free", allowed)


def console() -> Console:
    """A console for tables; outside a terminal it is 200 columns wide."""
    from rich.console import Console  # noqa: PLC0415

    width = None if sys.stdout.isatty() else 200
    return Console(highlight=False, markup=False, width=width)


def print_table(
    headings: Sequence[str],
    rows: Iterable[Sequence[str]],
    *,
    title: str | None = None,
    left: Container[int] = (0,),
    dim: Container[int] = (),
) -> None:
    """Print a table: columns to the right, but for those in `left`; those in `dim` are dimmed."""
    from rich.table import Table  # noqa: PLC0415

    table = Table(title=title, box=None, pad_edge=False, title_justify="left", title_style="bold")
    for k, heading in enumerate(headings):
        side: Literal["left", "right"] = "left" if k in left else "right"
        table.add_column(heading, justify=side, style="dim" if k in dim else None, no_wrap=True)
    for row in rows:
        table.add_row(*row)
    console().print(table)


@contextmanager
def progress_bar(title: str) -> Iterator[Callable[[float], None]]:
    """Yield a function to call with the share of work done, 0 to 1; only a terminal has a bar."""
    if not sys.stderr.isatty():
        yield lambda share: None
        return
    from rich.console import Console  # noqa: PLC0415
    from rich.progress import Progress  # noqa: PLC0415

    with Progress(console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(title, total=1.0)
        yield lambda share: bar.update(task, completed=share)
