"""The two processes of the bench: the rig, and what drives it."""

from __future__ import annotations

import json
import subprocess
import sys
from argparse import Namespace
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from tautscope.config import Config, dump_config, load_config
from tautscope.dof import Dof

BENCH = Path(__file__).resolve().parents[1] / "configs" / "bench.toml"
PATIENCE = 60.0
TAUTSCOPE = [sys.executable, "-c", "from tautscope.cli import main; raise SystemExit(main())"]


def bench_config(folder: Path, arguments: Namespace) -> Config:
    """The bench with its sockets in a folder."""
    changes = {
        "drives.channel": str(folder / "can"),
        "camera.source.url": f"unix:{folder / 'video'}",
        "twin.seed": arguments.seed,
        "profile": arguments.profile,
        "experiment.periods": arguments.periods,
    }
    changes |= {f"experiment.{dof.label}.period": arguments.period for dof in Dof}
    return load_config(BENCH).replace(**changes)


class Rig:
    """The process that is the rig."""

    def __init__(self, process: subprocess.Popen[str]) -> None:
        self._process = process

    def request(self, line: str) -> None:
        """Ask for a fault."""
        assert self._process.stdin is not None
        print(line, file=self._process.stdin, flush=True)

    def event(self, what: str, dof: str | None = None) -> float:
        """When the next event of this kind was [s, monotonic clock]."""
        assert self._process.stdout is not None
        for text in self._process.stdout:
            found = json.loads(text)
            if found["what"] == what and dof in {None, found.get("dof")}:
                return float(found["time"])
        raise RuntimeError(f"the bench ended before {what!r}")

    def until(self, what: str) -> list[tuple[float, str]]:
        """When what happened until an event of this kind [s, monotonic clock]."""
        assert self._process.stdout is not None
        events = []
        for text in self._process.stdout:
            line = json.loads(text)
            if line["what"] == what:
                break
            events.append((line["time"], line["what"]))
        return events


@contextmanager
def rig(config: Config, folder: Path, *more: str) -> Iterator[Rig]:
    """`tautscope bench`, ready to be driven."""
    file = folder / "rig.toml"
    file.write_text(dump_config(config), encoding="utf-8")
    with subprocess.Popen(
        [*TAUTSCOPE, "bench", "--config", str(file), *more],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    ) as process:
        found = Rig(process)
        found.event("ready")
        try:
            yield found
        finally:
            process.communicate(timeout=PATIENCE)


def run(file: Path, out: Path, *more: str) -> subprocess.Popen[str]:
    """`tautscope run`, the process that drives it."""
    return subprocess.Popen(
        [*TAUTSCOPE, "run", str(file), "--out", str(out), "--json", *more],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
