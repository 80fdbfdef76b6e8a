"""Real-time settings, as the kernel reports them."""

import gc
import os
import sys
import threading
from pathlib import Path

import pytest
from tautscope.hardware import realtime

linux = pytest.mark.skipif(sys.platform != "linux", reason="Linux only")


def locked() -> int:
    """Locked memory of this process [kB]."""
    lines = Path("/proc/self/status").read_text(encoding="ascii").splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith("VmLck"))


@linux
def test_memory_is_locked_for_the_block() -> None:
    with realtime.locked_memory() as refusal:
        inside = locked()
    assert (inside > 0) == (not refusal)
    assert not refusal or "memlock unlimited" in refusal
    assert locked() == 0


@linux
def test_refused_memory_lock_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(realtime, "_MLOCK_ON_FAULT", 1 << 20)  # the kernel refuses such a flag
    with realtime.locked_memory() as refusal:
        assert "Invalid argument" in refusal
        assert locked() == 0


@linux
def test_thread_lowers_its_inherited_priority() -> None:
    found: list[tuple[int, int]] = []

    def work() -> None:
        realtime.lower_realtime_priority(realtime.VISION)
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


def test_existing_objects_are_frozen() -> None:
    with realtime.limited_garbage_collection():
        assert gc.get_freeze_count() > 1000
    assert gc.get_freeze_count() == 0


def test_no_full_garbage_collection_in_the_block() -> None:
    before = gc.get_threshold()
    with realtime.limited_garbage_collection():
        count = gc.get_stats()[2]["collections"]
        kept = [[index] for index in range(2_000_000)]
        assert gc.get_stats()[2]["collections"] == count
    assert len(kept) == 2_000_000
    assert gc.get_threshold() == before
