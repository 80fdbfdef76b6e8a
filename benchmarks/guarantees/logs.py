"""Goals of the log: disks that are full or slow, and logs that are truncated or damaged."""

import errno
import math
import os
import tempfile
import time
from contextlib import ExitStack
from dataclasses import dataclass
from io import FileIO, RawIOBase
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
from faults.operator_input import OperatorInput
from faults.scenarios import build_config
from guarantees.goals import Measurement
from tautscope import HysteresisReduction, Twin
from tautscope.dof import Dof
from tautscope.errors import OutputError, RecordError
from tautscope.log import journal
from tautscope.log.reader import read_log
from tautscope.log.writer import LogWriter
from tautscope.loop.rig import Sample
from tautscope.runs.experiment import run_experiment

FLIPS = 1_000
"""Number of logs with a flipped bit, in addition to the truncated ones."""
SYNC_TIME = 5.0
"""How long a slow disk takes to store what was written [s]."""
DURATION = 0.5
"""Duration of a logged run [s]."""
CHUNK = 0.02
"""Duration of a chunk of a log that is truncated, by the wall clock [s]."""
WARNING_LIMIT = 1.0
"""Time after a failed write within which the log must warn [s]."""


@dataclass(frozen=True)
class _LoggedRun:
    """Result of a run with a log on a bad disk.

    Attributes:
        writes: Number of writes.
        late: Ticks that were late because of the log.
        warned: Time from the failure to the first warning [s]; infinite without a warning.
        lost: Ticks from earlier than two flush periods before the failure that cannot be read.
    """

    writes: int
    late: int
    warned: float
    lost: int


def disks() -> Measurement:
    """Measure G17: the n-th and all later writes fail, for every n; and a disk takes 5 s to store.

    No tick may wait, the log must warn, and what was written before must be readable.
    """
    whole = _run(None, 0.0)
    failing = [_run(number, 0.0) for number in range(2, whole.writes + 1)]
    runs = [*failing, _run(None, SYNC_TIME)]
    late, lost = sum(run.late for run in runs), sum(run.lost for run in runs)
    text = (
        f"{len(failing)} failing writes, a disk of {SYNC_TIME:g} s: {late} ticks late, {lost} "
        f"written ones lost, warning within {max(run.warned for run in failing):.2f} s"
    )
    failures = late + lost + sum(run.warned > WARNING_LIMIT for run in failing)
    return Measurement(text, str(len(runs)), failures, "17")


class _Disk(RawIOBase):
    """File on a disk that is full from one write on."""

    def __init__(self, path: Path, fails: int | None) -> None:
        super().__init__()
        self._file, self._fails = FileIO(path, "xb"), fails
        self.writes, self.failed_at = 0, math.inf

    def write(self, data: Any, /) -> int:
        self.writes += 1
        if self._fails is not None and self.writes >= self._fails:
            self.failed_at = min(self.failed_at, time.monotonic())
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return self._file.write(data)

    def fileno(self) -> int:
        return self._file.fileno()

    def close(self) -> None:
        self._file.close()
        super().close()


def _run(fails: int | None, sync_time: float) -> _LoggedRun:
    """Run the loop in real time with a log on a disk that is full from a write on, or slow."""
    config = build_config(17, "best", ()).replace(
        **{"recording.sync_period": 0.3, "recording.close_timeout": 2 * SYNC_TIME}
    )
    period, limit = config.control.period, config.safety.late_tick * config.control.period
    warnings: list[float] = []
    opened: list[_Disk] = []

    def open_disk(path: Path) -> _Disk:
        opened.append(_Disk(path, fails))
        return opened[0]

    def sync(_: int) -> None:
        time.sleep(sync_time)

    with tempfile.TemporaryDirectory() as folder, ExitStack() as stack:
        stack.enter_context(patch.object(journal, "_open", open_disk))
        stack.enter_context(patch.object(journal.os, "fsync", sync))
        path = Path(folder) / "run.mcap"
        try:
            log = LogWriter(path, config, on_warning=lambda _: warnings.append(time.monotonic()))
        except OutputError:  # the header does not fit: refused before any motion
            return _LoggedRun(opened[0].writes, 0, 0.0, 0)
        loop, late, ticks = HysteresisReduction(config), 0, []
        for tick in range(round(DURATION / period)):
            reference = [0.025 + 1e-5 * tick, 0.0, 0.9]
            command = loop.step(reference, tick * period)
            begin = time.monotonic()
            log.tick(Sample(tick * period, command), reference, command)
            took = time.monotonic() - begin
            ticks.append(begin)
            late += took > limit
            time.sleep(max(0.0, period - took))
        log.close()
        (disk,) = opened
        first = min(warnings, default=math.inf)
        try:
            readable = len(read_log(path).events)
        except RecordError:
            readable = 0
    until = disk.failed_at - 2 * config.recording.flush_period
    lost = max(0, sum(at < until for at in ticks) - readable)
    # A run may end before its n-th write.
    delay = first - disk.failed_at if math.isfinite(disk.failed_at) else 0.0
    return _LoggedRun(disk.writes, late, delay, lost)


def cuts(every: int) -> Measurement:
    """Measure G18: a log cut at every n-th byte, or with a flipped bit, is read, or refused."""
    with tempfile.TemporaryDirectory() as folder:
        whole = _recorded(Path(folder) / "whole.mcap")
        damaged = Path(folder) / "damaged.mcap"
        count, failures, most = 0, 0, 0
        for end in range(0, len(whole), every):
            damaged.write_bytes(whole[:end])
            readable = _readable(damaged)
            # A longer part of the log must not give less.
            failures += readable < most
            count, most = count + 1, max(most, readable)
        rng = np.random.default_rng(18)
        for _ in range(FLIPS):
            flipped = bytearray(whole)
            flipped[rng.integers(len(whole))] ^= 1 << int(rng.integers(8))
            damaged.write_bytes(flipped)
            _readable(damaged)
            count += 1
    return Measurement(
        f"{len(whole)} bytes, every {every}, {FLIPS} flips", str(count), failures, "18"
    )


def _recorded(path: Path) -> bytes:
    config = build_config(18, "best", ()).replace(**{"recording.flush_period": CHUNK})
    twin = Twin(config, images=False)
    motion = OperatorInput(config, dict.fromkeys(Dof, 3.0), lambda: twin.time, DURATION)
    with LogWriter(path, config) as log:
        run_experiment(twin, motion, config, log=log)
    return path.read_bytes()


def _readable(path: Path) -> int:
    """Return the number of readable events; an unexpected error is raised."""
    try:
        return len(read_log(path).events)
    except (RecordError, ValueError):
        return 0
