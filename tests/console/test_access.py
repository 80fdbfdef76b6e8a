"""Who may connect: hazards N1, N2 and the limits on what a connection may send."""

import http.client
import json
import socket
import time
from contextlib import suppress

import pytest
from running import Page, RunningConsole, rests
from tautscope.console.messages import LARGEST_MESSAGE
from tautscope.console.pages import Pages
from tautscope.console.server import BURST, RATE, RateLimit
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect

SOCKETS = ("/control", "/video")


def get(
    console: RunningConsole, method: str, path: str, **headers: str
) -> tuple[int, dict[str, str], bytes]:
    connection = http.client.HTTPConnection(console.host, timeout=20)
    try:
        connection.request(method, path, headers=headers)
        found = connection.getresponse()
        return found.status, dict(found.getheaders()), found.read()
    finally:
        connection.close()


def test_pages_are_files_of_the_package_and_confined() -> None:
    pages = Pages(["127.0.0.1:1"])
    assert set(pages.files) == {
        "/", "/index.html", "/style.css", "/icon.svg", "/plot.js", "/point.js",
        *(f"/{name}.js" for name in ("main", "link", "image", "charts", "path", "steer", "sound")),
    }  # fmt: skip
    assert sum(len(content) for _, content in set(pages.files.values())) < 200_000
    for path in pages.files:
        headers = pages.response(f"{path}?view").headers
        assert "default-src 'none'" in headers["Content-Security-Policy"]
        assert headers["X-Content-Type-Options"] == "nosniff"
        assert "Access-Control-Allow-Origin" not in headers
        assert "Set-Cookie" not in headers
    text = b"".join(content for _, content in pages.files.values()).decode()
    for line in text.splitlines():
        if "http" in line:
            assert "www.w3.org/2000/svg" in line, line  # a name, not an address


@pytest.mark.parametrize("path", ["/server.py", "/../server.py", "//etc/passwd", "/page"])
def test_no_other_file_can_be_requested(console: RunningConsole, path: str) -> None:
    assert get(console, "GET", path)[0] == 404


def test_every_route_without_a_token_changes_nothing(console: RunningConsole) -> None:
    command = console.command
    for path in (*Pages([]).files, *SOCKETS, "/stop", "/take"):
        for method in ("POST", "PUT", "PATCH", "DELETE", "OPTIONS"):
            # Before websockets 17 the connection is closed without an answer.
            with suppress(http.client.RemoteDisconnected):
                assert get(console, method, path)[0] == 405
    for path in SOCKETS:
        for token in ("", console.token[:-1], console.token + "x", "é" * 20):
            page = console.page(path, token)
            with pytest.raises(ConnectionClosed) as refused:
                page.socket.recv(timeout=20)
            assert refused.value.rcvd is not None
            assert refused.value.rcvd.code == 1008
    for first in ({"type": "take"}, {"type": "stop"}, ["hello"], {"type": "hello"}, 3, None):
        with connect(f"ws://{console.host}/control", origin=console.origin) as raw:
            raw.send(json.dumps(first))
            with pytest.raises(ConnectionClosed):
                raw.recv(timeout=20)
    assert console.control.lease.holder is None
    assert not console.control.operator.stopped_by
    assert (console.command == command).all()


@pytest.mark.parametrize("path", SOCKETS)
def test_other_origins_and_hosts_are_refused(console: RunningConsole, path: str) -> None:
    port = console.host.rpartition(":")[2]
    for origin in (
        None, "null", f"http://evil.example:{port}", "http://127.0.0.1", f"https://{console.host}",
        f"http://127.0.0.1.evil.example:{port}", f"{console.origin}.evil.example",
    ):  # fmt: skip
        with (
            pytest.raises(InvalidStatus) as refused,
            connect(f"ws://{console.host}{path}", origin=origin),
        ):
            pass
        assert refused.value.response.status_code == 403
    # DNS rebinding: the name of another server with this address.
    for host in (f"evil.example:{port}", "127.0.0.1", f"127.0.0.1:{int(port) + 1}", ""):
        assert get(console, "GET", "/", Host=host)[0] == 403
        assert get(console, "GET", path, Host=host)[0] == 403
    with socket.create_connection(console.host.split(":"), timeout=20) as raw:  # type: ignore[arg-type]
        hosts = f"Host: {console.host}\r\nHost: evil.example\r\n"
        raw.sendall(f"GET / HTTP/1.1\r\n{hosts}\r\n".encode())
        assert raw.recv(4096).startswith(b"HTTP/1.1 403")


def test_a_connection_without_its_token_is_closed(console: RunningConsole) -> None:
    with (
        connect(f"ws://{console.host}/control", origin=console.origin) as silent,
        pytest.raises(ConnectionClosed),
    ):
        silent.recv(timeout=20)


@pytest.mark.parametrize(
    "message",
    [
        "x",
        "{}",
        '{"type": "servo"}',
        '{"type": "servo", "lease": 1, "sequence": 1, "image": 1, "axes": [2, 0, 0],'
        ' "is_holding": true}',
        '{"type": "servo", "lease": 1, "sequence": 1, "image": 1, "axes": [1e999, 0, 0],'
        ' "is_holding": true}',
        '{"type": "take", "client": 7}',
        '{"type": "action", "lease": 1, "sequence": 1, "image": 1, "name": "__init__"}',
        b"\xff\xfe",
        "[" * LARGEST_MESSAGE,
        "x" * (LARGEST_MESSAGE + 1),
    ],
)
def test_a_malformed_message_ends_its_connection(console: RunningConsole, message) -> None:
    page = console.page()
    page.wait(lambda: bool(page.state))
    page.socket.send(message)
    assert page.is_closed.wait(20)
    assert console.control.lease.holder is None


def test_a_flood_ends_its_connection_and_not_that_of_others(console: RunningConsole) -> None:
    other, flood = console.page(), console.page()
    other.wait(lambda: bool(other.state))
    with pytest.raises(ConnectionClosed):
        while True:
            flood.send({"type": "action", "name": "still", "lease": 0, "sequence": 0, "image": 0})
    other.send({"type": "stop"})
    other.wait(lambda: other.state["motion"] == "stopped")
    other.take()
    assert other.request(type="action", name="enable")["is_accepted"]
    other.close()
    assert rests(console, 0.05)


def test_rates_are_those_of_a_token_bucket() -> None:
    limit = RateLimit(0.0)
    assert sum(limit.allows(0.0) for _ in range(1000)) == BURST
    allowed = sum(limit.allows(k / 1000) for k in range(1, 5001))
    assert allowed == pytest.approx(RATE * 5, abs=1)


def test_connections_are_limited(console: RunningConsole) -> None:
    pages: list[Page] = []
    with pytest.raises((InvalidStatus, ConnectionClosed, AssertionError)):
        for _ in range(100):
            pages.append(console.page())
            pages[-1].wait(lambda: pages[-1].client or pages[-1].is_closed.is_set())
            assert pages[-1].client
    assert 10 < len(pages) < 40
    for page in pages:
        page.close()
    again = None
    deadline = time.monotonic() + 20
    while again is None:  # until the server has noticed
        assert time.monotonic() < deadline
        with suppress(InvalidStatus, ConnectionClosed):
            again = console.page()
    again.wait(lambda: again.client)
    again.close()
