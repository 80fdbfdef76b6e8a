"""What keeps set-points punctual; the kernel says whether it is in force."""

from __future__ import annotations

import gc
import os
import sys
import threading
from pathlib import Path

import pytest
from tautscope.hardware import realtime

linux = pytest.mark.skipif(sys.platform != "linux", reason="asks Linux")


def locked() -> int:
    """Memory of this process that the kernel may not page out [kB]."""
    lines = Path("/proc/self/status").read_text(encoding="ascii").splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith("VmLck"))


@linux
def test_memory_stays_while_the_block_lasts() -> None:
    with realtime.memory_kept() as refusal:
        inside = locked()
    assert (inside > 0) == (not refusal)
    assert not refusal or "memlock unlimited" in refusal
    assert locked() == 0


@linux
def test_memory_that_may_not_be_kept_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(realtime, "_LOCK_AS_TOUCHED", 1 << 20)  # the kernel refuses such a flag
    with realtime.memory_kept() as refusal:
        assert "Invalid argument" in refusal
        assert locked() == 0


@linux
def test_a_thread_steps_back_from_what_it_inherited() -> None:
    found: list[tuple[int, int]] = []

    def work() -> None:
        realtime.step_back(realtime.VISION)
        found.append((os.sched_getscheduler(0), os.sched_getparam(0).sched_priority))

    def run() -> None:
        thread = threading.Thread(target=work)
        thread.start()
        thread.join()

    run()
    with realtime.realtime(realtime.SETPOINTS) as refusal:
        run()
    plain, inherited = found
    assert plain == (os.sched_getscheduler(0), 0)
    assert inherited == (plain if refusal else (os.SCHED_FIFO, realtime.VISION))


def test_collections_pass_over_what_was_there_before() -> None:
    with realtime.little_collection():
        assert gc.get_freeze_count() > 1000
    assert gc.get_freeze_count() == 0


def test_what_a_run_keeps_is_not_searched_while_it_lasts() -> None:
    before = gc.get_threshold()
    with realtime.little_collection():
        count = gc.get_stats()[2]["collections"]
        kept = [[index] for index in range(2_000_000)]
        assert gc.get_stats()[2]["collections"] == count
    assert len(kept) == 2_000_000
    assert gc.get_threshold() == before
