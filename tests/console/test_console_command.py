"""The command ``tautscope console``: what it steers, and where it listens."""

import json
import signal
import socket
import subprocess
import sys
import time
from argparse import Namespace
from pathlib import Path

import pytest
import tautscope
from console.pages import Page, console
from refused import failed
from tautscope.commands.rig_choice import choose_rig
from tautscope.config import load_config
from tautscope.console.rig_control import RigControl
from tautscope.errors import STOPPED
from tautscope.hardware.rig import HardwareRig
from tautscope.twin.rig import Twin

COMMAND = [sys.executable, "-m", "tautscope", "console"]


def test_drives_need_a_configuration_and_the_twin_has_none(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert "drives: got None" in failed(capsys, "console")
    assert "--robot: got 'colonoscope'" in failed(capsys, "console", "--robot", "colonoscope")
    assert "rig: got 'nothing:Here'" in failed(capsys, "console", "--rig", "nothing:Here")
    colonoscope = ("console", "--twin", "--config", "colonoscope")
    assert "this is for the article's instrument" in failed(capsys, *colonoscope)
    err = failed(capsys, "console", "--config", "article_rig")
    assert "placeholders of" in err
    config, make = choose_rig(Namespace(config="bench", twin=True))
    assert config.drives is None
    twin = make(config)
    assert isinstance(twin, Twin)
    twin.close()
    config, make = choose_rig(Namespace(config="bench"))
    assert config.drives == load_config("bench").drives
    assert isinstance(make(config), HardwareRig)


def test_motors_are_enabled_only_on_request(tmp_path: Path) -> None:
    config = load_config("bench")
    control = RigControl(config, HardwareRig(config), tmp_path, None)  # type: ignore[arg-type]
    assert control.is_hardware
    assert control.run is None
    control.shut_down()
    assert list(tmp_path.iterdir()) == []


def test_a_taken_port_is_refused(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = str(taken.getsockname()[1])
        err = failed(capsys, "console", "--twin", "--port", port, "--out", str(tmp_path / "a"))
    assert f"port: got {port}, expected a free port" in err
    assert "port: got 70000" in failed(capsys, "console", "--twin", "--port", "70000")


@pytest.mark.parametrize("options", [(), ("--robot", "colonoscope")], ids=["article", "robot"])
def test_it_prints_its_address_and_ends_with_ctrl_c(
    tmp_path: Path, options: tuple[str, ...]
) -> None:
    command = [*COMMAND, "--twin", *options, "--json", "--out", str(tmp_path / "out")]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        url = json.loads(process.stdout.readline())["url"]
        assert url.startswith("http://127.0.0.1:")
        host = url.removeprefix("http://").split("/")[0]
        with socket.create_connection(host.split(":"), timeout=30) as raw:  # type: ignore[arg-type]
            raw.sendall(f"GET / HTTP/1.1\r\nHost: {host}\r\n\r\n".encode())
            assert raw.recv(100).startswith(b"HTTP/1.1 200")
        while not (tmp_path / "out" / "console-1.mcap").exists():
            assert process.poll() is None
        process.send_signal(signal.SIGINT)
        assert process.wait(30) == 0
        assert process.stderr.read() == b""
        assert json.loads(process.stdout.read()) == {"log": str(tmp_path / "out/console-1.mcap")}


RIG = """
from tautscope import PlayRig
from tautscope.errors import StateError
class Silent(PlayRig):
    def close(self):
        raise StateError("x", "quick stop is not confirmed", "Use the emergency stop: it may move")
"""


def test_motors_that_may_still_move_are_its_exit_status(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("silent.py").write_text(RIG, encoding="utf-8")
    config = tautscope.axes(2, width_limit=1.0)
    with console(tmp_path, config, "--rig", "silent:Silent") as (address, process):
        page = Page(address)
        page.take()
        while not (tmp_path / "out" / "console-1.mcap").exists():
            page.servo((0.0, 0.0), is_holding=False)
            if page.state["motion"] == "off":
                page.action("enable")
            time.sleep(0.1)
        page.close()
    assert process.returncode == STOPPED
    assert "error: rig: the motors may still move (x: quick stop" in capfd.readouterr().err
