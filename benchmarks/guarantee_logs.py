"""Goals of the log: disks that are full or slow, and logs that were cut or spoilt."""

from __future__ import annotations

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
from fault_draws import configured
from fault_hand import Hand
from guarantee_rows import Figure
from tautscope import HysteresisReduction, Twin
from tautscope.dof import Dof
from tautscope.errors import RecordError
from tautscope.log import journal
from tautscope.log.reader import read_log
from tautscope.log.writer import LogWriter
from tautscope.loop.rig import Sample
from tautscope.runs.experiment import run_experiment

FLIPS = 1_000
"""Bits flipped, beside the cuts."""
SLOW = 5.0
"""How long a disk takes to store what was written [s]."""
SECONDS = 0.5
"""Of a run that is logged [s]."""
CUT, CHUNK = 0.5, 0.02
"""Of a run whose log is cut, on the twin's clock, and of a chunk of it, on the wall's [s]."""
ALARM = 1.0
"""After a failed write, in which it is to be said [s]."""


@dataclass(frozen=True)
class _Told:
    """What came of a run with a log.

    Attributes:
        writes: How many there were.
        missed: Ticks that were made late because of the log.
        said: Time from the failure to the first word of it [s]; infinite if there was none.
        lost: Ticks made two flush periods before the failure that cannot be read.
    """

    writes: int
    missed: int
    said: float
    lost: int


def disks() -> Figure:
    """G17: the n-th write and all after it fail, for every n, and a disk that takes 5 s to store.

    No tick may wait for it, a failure is to be said, and what was written before is readable.
    """
    whole = _run(None, 0.0)
    failing = [_run(number, 0.0) for number in range(2, whole.writes + 1)]
    told = [*failing, _run(None, SLOW)]
    missed = sum(each.missed for each in told)
    lost = sum(each.lost for each in told)
    latest = max(each.said for each in failing)
    text = (
        f"{len(failing)} failing writes, a disk of {SLOW:g} s: {missed} ticks late, {lost} lost "
        f"that were made in time, said within {latest:.2f} s"
    )
    broken = missed + lost + sum(each.said > ALARM for each in failing)
    return Figure(text, str(len(told)), broken, "17")


class _Disk(RawIOBase):
    """A file of which a write, and all after it, find the disk full."""

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


def _run(fails: int | None, slow: float) -> _Told:
    """The loop in real time, with a log on such a disk."""
    config = configured(17, "best", ()).replace(
        **{"recording.sync_period": 0.3, "recording.close_timeout": 2 * SLOW}
    )
    period, late = config.control.period, config.safety.late_tick * config.control.period
    said: list[float] = []
    made: list[_Disk] = []

    def opened(path: Path) -> _Disk:
        made.append(_Disk(path, fails))
        return made[0]

    def stores(_: int) -> None:
        time.sleep(slow)

    with tempfile.TemporaryDirectory() as folder, ExitStack() as stack:
        stack.enter_context(patch.object(journal, "_open", opened))
        stack.enter_context(patch.object(journal.os, "fsync", stores))
        path = Path(folder) / "run.mcap"
        log = LogWriter(path, config, on_warning=lambda _: said.append(time.monotonic()))
        loop, missed, made_at = HysteresisReduction(config), 0, []
        for tick in range(round(SECONDS / period)):
            reference = [0.025 + 1e-5 * tick, 0.0, 0.9]
            command = loop.step(reference, tick * period)
            begin = time.monotonic()
            log.tick(Sample(tick * period, command), reference, command)
            took = time.monotonic() - begin
            made_at.append(begin)
            missed += took > late
            time.sleep(max(0.0, period - took))
        log.close()
        (disk,) = made
        first = min(said, default=math.inf)
        try:
            readable = len(read_log(path).events)
        except RecordError:
            readable = 0
    until = disk.failed_at - 2 * config.recording.flush_period
    lost = max(0, sum(at < until for at in made_at) - readable)
    # Not every run writes as often: the last failure may not have come.
    delay = first - disk.failed_at if math.isfinite(disk.failed_at) else 0.0
    return _Told(disk.writes, missed, delay, lost)


def cuts(every: int) -> Figure:
    """G18: a log cut at every n-th byte, and with a bit flipped, is read or refused by name."""
    with tempfile.TemporaryDirectory() as folder:
        whole = _recorded(Path(folder) / "whole.mcap")
        torn = Path(folder) / "torn.mcap"
        ticks, tried, broken, before = 0, 0, 0, 0
        for end in range(0, len(whole), every):
            torn.write_bytes(whole[:end])
            ticks = _readable(torn)
            # What could be read of less is there of more.
            broken += ticks < before
            before, tried = max(before, ticks), tried + 1
        chance = np.random.default_rng(18)
        for _ in range(FLIPS):
            spoilt = bytearray(whole)
            spoilt[chance.integers(len(whole))] ^= 1 << int(chance.integers(8))
            torn.write_bytes(spoilt)
            _readable(torn)
            tried += 1
    return Figure(f"{len(whole)} bytes, every {every}, {FLIPS} flips", str(tried), broken, "18")


def _recorded(path: Path) -> bytes:
    config = configured(18, "best", ()).replace(**{"recording.flush_period": CHUNK})
    twin = Twin(config, images=False)
    hand = Hand(config, dict.fromkeys(Dof, 3.0), lambda: twin.time, CUT)
    with LogWriter(path, config) as log:
        run_experiment(twin, hand, config, log=log)
    return path.read_bytes()


def _readable(path: Path) -> int:
    """How many events are read; anything but a named error would come out."""
    try:
        return len(read_log(path).events)
    except (RecordError, ValueError):
        return 0
