"""Hazards of steering and of a second master: runs, and how many of them failed."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

from console.pages import PERIOD, Address, Page, console, sized
from guarantees.goals import Measurement
from tautscope.config import load_config
from tautscope.errors import SecondMasterError
from tautscope.hardware.rig_lock import RigLock

HOLD_LOCK = """
import sys
from tautscope.config import load_config
from tautscope.hardware.rig_lock import RigLock
RigLock(load_config("bench").drives)
print(flush=True)
sys.stdin.read()
"""


def replays(page: Page, count: int) -> Measurement:
    """N5: repeated, reordered and old commands while the reference should rest."""
    failures = 0
    for k in range(count):
        page.ready()
        page.hold(((-1) ** k, 0, 0))
        page.servo(is_holding=False)
        page.wait(lambda: page.state["motion"] == "ready")
        old = page.fields()
        time.sleep(0.06)
        before = page.state["reference"]
        if k % 3 == 1:  # an old image
            old = page.fields(max(page.state["image"]["sequence"] - 12, 0))
        elif k % 3 == 2:  # a lease that has been given up
            old = {**page.fields(), "lease": page.state["lease"] - 1}
        else:
            page.servo(is_holding=False)
        for _ in range(3):
            page.send({"type": "servo", **old, "axes": [1, 1, 1], "is_holding": True})
        time.sleep(0.06)
        failures += page.state["reference"] != before
    return Measurement("nothing moved", str(count), failures)


def link_losses(address: Address, page: Page, count: int) -> Measurement:
    """N3: the page falls silent or is closed while it steers: time until the reference rests."""
    times = []
    watched = Page(address)
    moved_at = 0.0
    last: list[float] = []

    def watch(state: dict[str, object]) -> None:
        nonlocal moved_at, last
        if state["reference"] != last:
            last, moved_at = state["reference"], state["now"]  # type: ignore[assignment]

    watched.on_state = watch
    for k in range(count):
        operator = page
        if k % 2:
            operator = Page(address)
            operator.take()
        else:
            page.take()
        operator.ready()
        operator.hold(((-1) ** (k // 2), 0, 0))
        sent = time.monotonic()
        operator.servo(((-1) ** (k // 2), 0, 0))
        if k % 2:
            operator.socket.socket.shutdown(2)  # as when the cable is pulled
        time.sleep(0.35)
        times.append(max(moved_at - sent, 0.0))
        operator.close() if k % 2 else None
    watched.close()
    return Measurement.of_times(times, 0.255, "")


def second_clients(address: Address, page: Page, count: int) -> Measurement:
    """M1, G20: a second page that commands without the lease."""
    page.take()
    page.ready()
    failures = 0
    for _ in range(count):
        second = Page(address)
        before = page.state["reference"]
        for k in range(6):
            second.servo(is_holding=k > 1)
        second.action("home")
        second.wait(lambda s=second: s.replies)  # type: ignore[misc]
        failures += second.replies[0]["is_accepted"] or page.state["reference"] != before
        second.close()
    return Measurement("all refused", str(count), failures)


@contextmanager
def another_master() -> Iterator[subprocess.Popen[bytes]]:
    command = [sys.executable, "-c", HOLD_LOCK]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        process.stdout.readline()
        try:
            yield process
        finally:
            process.kill()


def second_masters(count: int) -> Measurement:
    """M1, G21: a second program that opens the drives of the same bus."""
    drives = load_config("bench").drives
    assert drives is not None
    failures = 0
    with another_master():
        for _ in range(count):
            try:
                RigLock(drives).release()
                failures += 1
            except SecondMasterError:
                pass
    RigLock(drives).release()
    return Measurement("all refused", str(count), failures)


def stops(address: Address, page: Page, count: int, load: int) -> Measurement:
    """N4, G20: time from STOP of a page that watches until it is in force, under load."""
    times = []
    watcher = Page(address)
    with ExitStack() as stack:
        for _ in range(load):
            busy = stack.enter_context(subprocess.Popen([sys.executable, "-c", "while True: pass"]))
            stack.callback(busy.kill)
        for _ in range(count):
            page.take()
            page.ready()
            page.hold((1 if page.state["reference"][0] < 0.025 else -1, 0, 0))
            before = page.state["stopped_at"]
            sent = time.monotonic()
            watcher.send({"type": "stop"})
            page.wait(lambda b=before: page.state["stopped_at"] != b)  # type: ignore[misc]
            times.append(page.state["stopped_at"] - sent)
            time.sleep(PERIOD)
    watcher.close()
    times.sort()
    p99 = times[min(int(0.99 * len(times)), len(times) - 1)]
    text = f"median {1e3 * times[len(times) // 2]:.1f} ms, p99 {1e3 * p99:.1f} ms, "
    late = sum(each > 0.05 for each in times)
    text += f"largest {1e3 * times[-1]:.1f} ms; {late} above 50 ms"
    return Measurement(text, str(count), int(p99 > 0.05))


def held_networks(folder: Path, count: int) -> Measurement:
    """N3, N5: everything between page and loop stands for 2 s, then all arrives at once."""
    failures = 0
    with console(folder, sized("720x576"), "--twin") as (address, process):
        page = Page(address)
        page.take()
        server = _children(process.pid)[-1]
        for k in range(count):
            page.ready()
            direction = ((-1) ** k, 0, 0)
            page.hold(direction)
            os.kill(server, signal.SIGSTOP)
            end = time.monotonic() + 2
            while time.monotonic() < end:
                page.servo(direction)
                time.sleep(PERIOD)
            os.kill(server, signal.SIGCONT)
            time.sleep(0.2)
            before = page.state["reference"]
            time.sleep(0.5)
            failures += page.state["reference"] != before
        page.close()
    return Measurement("nothing moved afterwards", str(count), failures)


def _children(pid: int) -> list[int]:
    text = Path(f"/proc/{pid}/task/{pid}/children").read_text(encoding="ascii")
    return [int(child) for child in text.split()]
