"""The two processes of the bench: the rig, and the one that controls it."""

import json
import subprocess
import sys
from argparse import Namespace
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from tautscope.config import Config, dump_config, load_config
from tautscope.dof import Dof

TIMEOUT = 60.0
"""Time within which a process must end [s]."""
TAUTSCOPE = [sys.executable, "-c", "from tautscope.cli import main; raise SystemExit(main())"]


def bench_config(folder: Path, arguments: Namespace) -> Config:
    """Return the configuration of the bench with its sockets in a folder."""
    changes = {
        "drives.channel": str(folder / "bus"),
        "camera.source.url": f"unix:{folder / 'video'}",
        "twin.seed": arguments.seed,
        "profile": arguments.profile,
        "experiment.periods": arguments.periods,
    }
    if arguments.heartbeat_timeout is not None:
        changes["drives.heartbeat_timeout"] = arguments.heartbeat_timeout
    if arguments.period is not None:
        changes |= {f"experiment.{dof.label}.period": arguments.period for dof in Dof}
    return load_config(arguments.config).replace(**changes)


class Rig:
    """Process that simulates the rig; takes requests, and prints events as JSON lines."""

    def __init__(self, process: subprocess.Popen[str]) -> None:
        self._process = process

    def request(self, line: str) -> None:
        """Request a fault."""
        assert self._process.stdin is not None
        print(line, file=self._process.stdin, flush=True)

    def event(self, what: str, dof: str | None = None) -> float:
        """Wait for the next event of this kind and return its time [s, monotonic clock]."""
        assert self._process.stdout is not None
        for text in self._process.stdout:
            found = json.loads(text)
            if found["what"] == what and dof in {None, found.get("dof")}:
                return float(found["time"])
        raise RuntimeError(f"the simulated rig ended before the event {what!r}")

    def until(self, what: str) -> list[tuple[float, str]]:
        """Return (time [s, monotonic clock], kind) of all events before the next of this kind."""
        assert self._process.stdout is not None
        events = []
        for text in self._process.stdout:
            line = json.loads(text)
            if line["what"] == what:
                break
            events.append((line["time"], line["what"]))
        return events


@contextmanager
def start_rig(config: Config, folder: Path, *more: str) -> Iterator[Rig]:
    """Start `tautscope bench` and wait until it is ready."""
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
            process.communicate(timeout=TIMEOUT)


def call(*words: str | Path, statuses: tuple[int, ...] = (0,)) -> Any:
    """Carry out a command with ``--json`` that ends with one of the statuses; what it prints."""
    done = subprocess.run(
        [*TAUTSCOPE, *map(str, words), "--json"], capture_output=True, text=True, check=False
    )
    if done.returncode not in statuses:
        raise RuntimeError(f"{' '.join(map(str, words))}: {done.stdout} {done.stderr}")
    return json.loads(done.stdout)


def run(file: Path, out: Path, *more: str) -> subprocess.Popen[str]:
    """Start `tautscope run`, which controls the rig."""
    return subprocess.Popen(
        [*TAUTSCOPE, "run", "--config", str(file), "--out", str(out), "--yes", "--json", *more],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
