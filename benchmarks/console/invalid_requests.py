"""Requests that the console must refuse: without token, forged, malformed or random."""

import http.client
import itertools
import json
import random
import time
from contextlib import suppress

import msgspec
from console.pages import Address, Page
from guarantees.goals import Measurement
from tautscope.console import messages as msg
from tautscope.console.pages import Pages
from websockets.exceptions import InvalidHandshake, WebSocketException
from websockets.sync.client import ClientConnection, connect

METHODS = ("GET", "HEAD", "POST", "PUT", "PATCH", "DELETE", "OPTIONS", "TRACE")


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


def _connection(address: Address) -> ClientConnection:
    return connect(f"ws://{address.host}/control", origin=address.origin)  # type: ignore[arg-type]


def _token(address: Address, random_: random.Random, left: int) -> int:
    with suppress(WebSocketException), _connection(address) as socket:
        token = "".join(random_.choices("abcdefgh-_0123", k=43))
        socket.send(json.dumps({"type": "hello", "token": token}))
        socket.send(json.dumps({"type": "stop"}))
        socket.recv(timeout=20)
        raise RuntimeError("a wrong token was accepted")
    return 1


def _malformed(address: Address, random_: random.Random, left: int) -> int:
    """Commands without the lease, then one that is malformed, which ends the connection."""
    sent = 0
    with suppress(WebSocketException), _connection(address) as socket:
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
