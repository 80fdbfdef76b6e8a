"""What commands print: text, tables, progress, with ``--json`` one object; and what they ask."""

from __future__ import annotations

import argparse
import json
import shutil
import sys
from collections.abc import Callable, Container, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from tautscope.config import CameraConfig
from tautscope.errors import FieldError, OutputError

if TYPE_CHECKING:
    from rich.console import Console

TERMINAL = Path("/dev/tty")
"""Where questions are asked while images come through the standard input."""


def print_json(options: argparse.Namespace, document: dict[str, Any]) -> None:
    """With ``--json``, print a document in one line, at once; it must not contain NaN.

    `tautscope.cli` then prints nothing else on the standard output.
    """
    if options.json:
        print(json.dumps(document, allow_nan=False), file=options.stdout, flush=True)


def announce(what: str, seconds: float, size: float, folder: Path) -> None:
    """Print on stderr how long what runs takes [s], and the size [byte] and folder of its files.

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


def ask(question: str, camera: CameraConfig) -> str:
    """Ask on stderr, and return the line typed in lower case; empty if there is nobody to answer.

    If the images of the camera come through the standard input, the terminal is read instead.
    """
    print(question, end="", file=sys.stderr, flush=True)
    if not camera.source.url.startswith("pipe:"):
        return sys.stdin.readline().lower() if sys.stdin else ""  # None if it was closed
    try:
        with TERMINAL.open(encoding="utf-8") as terminal:
            return terminal.readline().lower()
    except OSError:
        return ""


def confirm(question: str, options: argparse.Namespace, camera: CameraConfig) -> None:
    """Ask whether the motors may move, unless ``--yes``; an error if the answer is not y."""
    if options.yes:
        return
    if ask(f"{question} Type y to start: ", camera).strip() not in ("y", "yes"):
        raise FieldError("answer", "no", "y, or the option --yes; nothing moved")
