"""Hazards of the console and of a second master: runs, and how many of them failed."""

from __future__ import annotations

import http.client
import itertools
import json
import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

import msgspec
from console.pages import PERIOD, Address, Page, console, sized
from guarantees.goals import Measurement
from tautscope.config import load_config
from tautscope.console import messages as msg
from tautscope.console.pages import Pages
from tautscope.errors import SecondMasterError
from tautscope.hardware.rig_lock import RigLock
from websockets.exceptions import InvalidHandshake, WebSocketException
from websockets.sync.client import connect

METHODS = ("GET", "HEAD", "POST", "PUT", "PATCH", "DELETE", "OPTIONS", "TRACE")
HOLD_LOCK = """
import sys
from tautscope.config import load_config
from tautscope.hardware.rig_lock import RigLock
RigLock(load_config("bench").drives)
print(flush=True)
sys.stdin.read()
"""


def requests(address: Address, page: Page, count: int, seed: int) -> Measurement:
    """N1, N2, G20: routes without token, forged origins and hosts, malformed messages."""
    random_ = random.Random(seed)
    reference = page.state["reference"]
    answered = failures = 0
    kinds = itertools.cycle((_route, _origin, _host, _token, _malformed))
    while answered < count:
        answered += next(kinds)(address, random_, count - answered)
        failures += page.state["reference"] != reference or page.state["holder"] is not None
    failures += page.state["motion"] != "ready"
    text = "no motion, no lease, all refused" if not failures else "motion or lease"
    return Measurement(text, str(answered), failures, str(seed))


def _route(address: Address, random_: random.Random, left: int) -> int:
    path = random_.choice([*Pages([]).files, "/control", "/video", "/stop", "/take", "/api"])
    method = random_.choice(METHODS[2:])
    connection = http.client.HTTPConnection(address.host, timeout=20)
    try:
        connection.request(method, path)
        if connection.getresponse().status < 400:
            raise RuntimeError(f"{method} {path} was answered")
    except http.client.HTTPException:
        pass
    finally:
        connection.close()
    return 1


def _origin(address: Address, random_: random.Random, left: int) -> int:
    origin = random_.choice(
        [None, "null", "http://evil.example", f"https://{address.host}", address.origin + "0"]
    )
    with (
        suppress(InvalidHandshake),
        connect(f"ws://{address.host}/control", origin=origin),  # type: ignore[arg-type]
    ):
        raise RuntimeError(f"origin {origin} was accepted")
    return 1


def _host(address: Address, random_: random.Random, left: int) -> int:
    connection = http.client.HTTPConnection(address.host, timeout=20)
    host = random_.choice(["evil.example", "127.0.0.1", address.host + "0", f"a.{address.host}"])
    try:
        connection.request("GET", "/", headers={"Host": host})
        if connection.getresponse().status != 403:
            raise RuntimeError(f"host {host} was answered")
    finally:
        connection.close()
    return 1


def _token(address: Address, random_: random.Random, left: int) -> int:
    with (
        suppress(WebSocketException),
        connect(
            f"ws://{address.host}/control",
            origin=address.origin,  # type: ignore[arg-type]
        ) as socket,
    ):
        token = "".join(random_.choices("abcdefgh-_0123", k=43))
        socket.send(json.dumps({"type": "hello", "token": token}))
        socket.send(json.dumps({"type": "stop"}))
        socket.recv(timeout=20)
        raise RuntimeError("a wrong token was accepted")
    return 1


def _malformed(address: Address, random_: random.Random, left: int) -> int:
    """Commands without the lease, then one that is malformed, which ends the connection."""
    sent = 0
    with (
        suppress(WebSocketException),
        connect(
            f"ws://{address.host}/control",
            origin=address.origin,  # type: ignore[arg-type]
        ) as socket,
    ):
        socket.send(json.dumps({"type": "hello", "token": address.token}))
        for _ in range(min(400, left)):
            fields = {"lease": random_.randrange(9), "sequence": random_.randrange(2**53)}
            fields["image"] = random_.randrange(10_000)
            name = random_.choice(["home", "experiment", "sweep", "enable", "release"])
            servo = {"type": "servo", "axes": [1, 1, 1], "is_holding": random_.random() < 0.5}
            socket.send(
                json.dumps({**random_.choice([servo, {"type": "action", "name": name}]), **fields})
            )
            sent += 1
        socket.send(mutated(random_))
        while True:
            socket.recv(timeout=20)
    return sent + 1


def mutated(random_: random.Random) -> bytes:
    """A message of which some bytes were replaced, so that it is no longer one."""
    message = msg.Servo(1, 1, 1, (1.0, 0.0, 0.0), True)
    while True:
        data = bytearray(msg.encode(message))
        for _ in range(random_.randint(1, 8)):
            data[random_.randrange(len(data))] = random_.randrange(256)
        try:
            msg.decode_control(bytes(data))
        except (msgspec.MsgspecError, UnicodeError):
            return bytes(data)


def fuzzing(seconds: float, seed: int) -> Measurement:
    """G11: random and mutated texts into the decoders of pages' messages."""
    random_ = random.Random(seed)
    seeds = [
        msg.encode(each)
        for each in (
            msg.Stop(), msg.Take(), msg.Servo(1, 2, 3, (0.5, -1.0, 0.0), True),
            msg.Action(1, 2, 3, "mark", "here"), msg.Setting(1, 2, 3, "scale", 0.5, "bending"),
            msg.SetProfile(1, 2, 3, "paper"), msg.Drawn(7, 800), msg.Hello("x" * 43),
        )
    ]  # fmt: skip
    decoders = (msg.decode_hello, msg.decode_control, msg.decode_video)
    runs = failures = 0
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        for _ in range(1000):
            data = bytearray(random_.choice(seeds))
            for _ in range(random_.randint(0, 6)):
                at = random_.randrange(len(data) + 1)
                data[at : at + random_.randint(0, 3)] = random_.randbytes(random_.randint(0, 3))
            for decode in decoders:
                runs += 1
                try:
                    found = decode(bytes(data))
                except (msgspec.MsgspecError, UnicodeError):
                    continue
                if isinstance(found, msg.Servo):
                    failures += not all(-1 <= axis <= 1 for axis in found.axes)
    return Measurement("no crash, all in range or refused", str(runs), failures, str(seed))


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
