"""The bench on a serial line: the twin behind a pseudo-terminal, in a process of its own."""

import json
import signal
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from drawn import with_half_images
from servo_settings import MODELS, TIMES
from tautscope.bench.rig import Bench
from tautscope.bench.servos import SimulatedServos
from tautscope.cli import main
from tautscope.config import Config, dump_config, from_document, load_config
from tautscope.config.root import to_document
from tautscope.console.messages import Received, Servo
from tautscope.console.rig_control import RigControl
from tautscope.dof import Dof
from tautscope.errors import ConfigError
from tautscope.hardware.experiment import run_on_hardware
from tautscope.hardware.motor_rig import require_drives
from tautscope.hardware.rig import HardwareRig
from tautscope.runs.recording import per_dof
from test_bench import RUN
from test_processes import Lines, process
from waiting import TIMEOUT, until

PROTOCOLS = pytest.mark.parametrize("protocol", [*sorted(MODELS), "serial"])
ENABLED = {"serial": "enabled"}
"""Event of an enabled motor where it is not "torque on"."""
FAULT = {"serial": ("fault: driver", "rotation, axis 2: it reports a fault: driver")}
CYCLE = TIMES["cycle"]


def bench_config(protocol: str, folder: Path) -> Config:
    """The shipped configuration of a bench, as `slow_config`."""
    return slow_config(f"bench_{protocol}", folder)


def slow_config(name: str, folder: Path) -> Config:
    """A shipped configuration for a busy computer: slow motion and cycles, long timeouts."""
    document = to_document(load_config(name))
    document["law"]["free_gain"] = 5.0
    document["control"]["period"] = CYCLE
    document["drives"] |= {
        "channel": str(folder / "servos"),
        "command_timeout": TIMEOUT,
        "start_speed": 0.5,
        **TIMES,
    }
    document["camera"]["source"] |= {
        "url": f"unix:{folder / 'video'}",
        "format": "nut",
        "options": {},
        "clock": "device",
    }
    document["camera"]["source"] |= dict.fromkeys(
        ("timeout", "start_timeout", "lost_timeout"), TIMEOUT
    )
    document["experiment"] = {
        "periods": 3,
        "insertion": {"centre": 0.025, "amplitude": 0.001, "period": 1.0},
        "rotation": {"centre": 0.0, "amplitude": 0.08, "period": 1.0},
        "bending": {"centre": 0.9, "amplitude": 0.05, "period": 1.0},
    }
    document["twin"] |= {"frame_rate": 12.5}
    document["recording"] |= {"image_format": "jpeg"}
    return with_half_images(from_document(document))


@contextmanager
def running_bench(config: Config, folder: Path) -> Iterator[tuple[Path, Any, Lines]]:
    """A bench in its own process: the file of its configuration, its input, its output."""
    file = folder / "rig.toml"
    file.write_text(dump_config(config), encoding="utf-8")
    with process("-c", RUN, "bench", "--config", str(file)) as (bench, lines):
        lines.until("ready")
        yield file, bench, lines


@PROTOCOLS
def test_a_protocol_runs_on_servos(protocol: str, tmp_path: Path) -> None:
    config = bench_config(protocol, tmp_path)
    with running_bench(config, tmp_path) as (_, _, lines):
        found = run_on_hardware(config, tmp_path / "run", lambda share: None)
        lines.until(ENABLED.get(protocol, "torque on"), 3)
    trace = found.compensated.recording.trace
    assert len(trace) == round(3 * 3 * 1.0 / CYCLE)
    # The motors did what the commands were, in distance if not in time.
    moved, commanded = (np.ptp(per_dof(trace, name), axis=0) for name in ("applied", "command"))
    resolution = [1 / require_drives(config)[dof].counts_per_unit for dof in Dof]
    assert (abs(moved - commanded) <= 0.1 * commanded + resolution).all()


@PROTOCOLS
def test_doctor_jog_and_a_fault_by_name(
    protocol: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    config = bench_config(protocol, tmp_path)
    servo = ("fault: overload", "rotation, servo 2: it reports a fault: overload")
    event, message = FAULT.get(protocol, servo)
    with running_bench(config, tmp_path) as (file, bench, lines):
        main(["doctor", "--config", str(file), "--json"])
        drives = [
            one
            for one in json.loads(capsys.readouterr().out)["findings"]
            if one["group"] == "drives"
        ]
        assert not [one for one in drives if one["status"] == "missing"]
        assert main(["jog", "bending", "0.1", "--yes", "--json", "--config", str(file)]) == 0
        moved = json.loads(capsys.readouterr().out)
        assert moved["moved"] == pytest.approx(0.1, abs=0.01)
        assert moved["ended_at"] == pytest.approx(0.0, abs=0.01)
        out = str(tmp_path / "run")
        with process("-c", RUN, "run", "--config", str(file), "--out", out, "--yes") as (
            running,
            _,
        ):
            lines.until(ENABLED.get(protocol, "torque on"), 3)
            bench.stdin.write("fault rotation\n")
            bench.stdin.flush()
            lines.until(event)
            assert running.wait(TIMEOUT) in (3, 4)  # before or after the loop began
            assert message in running.stderr.read()


@pytest.mark.parametrize("protocol", ["dynamixel", "serial"])
def test_the_console_enables_and_stops_motors(
    protocol: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("COMMAND_TIMEOUT", "IDLE_TIMEOUT"):
        monkeypatch.setattr(f"tautscope.console.operator_input.{name}", TIMEOUT)
    config = bench_config(protocol, tmp_path)
    with running_bench(config, tmp_path) as (_, _, lines), ThreadPoolExecutor(1) as executor:
        control = RigControl(config, HardwareRig(config), tmp_path / "console", executor)
        control.lease.take(1)
        now = time.monotonic()
        servo = Servo(control.lease.number, 1, 0, (0.0, 0.0, 0.0), False)
        control.operator.receive(Received(1, now, servo), now)
        try:
            control.open()
            lines.until(ENABLED.get(protocol, "torque on"), 3)
            assert control.run is not None, control.fault
            for _ in range(3):
                control.run.tick()
                control.run.step()
            control.stop("STOP")
            assert control.run is None
            assert control.fault == "STOP"
        finally:
            control.shut_down()


def test_a_bench_without_a_socket_of_images_leaves_nothing_behind(tmp_path: Path) -> None:
    config = bench_config("serial", tmp_path)
    notes = tmp_path / "notes.txt"
    notes.write_text("mine", encoding="utf-8")
    for place in (notes, tmp_path / "none" / "video"):
        bench = Bench(config.replace(**{"camera.source.url": f"unix:{place}"}))
        with pytest.raises(ConfigError, match=r"camera\.source\.url"), bench:
            pass
    assert notes.read_text(encoding="utf-8") == "mine"
    with Bench(config):
        assert Path(require_drives(config).channel).is_symlink()


def test_the_bench_is_no_device_and_survives_the_end_of_another(tmp_path: Path) -> None:
    config = bench_config("feetech", tmp_path)
    with pytest.raises(ConfigError, match=r"drives\.channel.*no device"):
        Bench(config.replace(**{"drives.channel": "/dev/ttyACM0"}))
    assert config.drives is not None
    with running_bench(config, tmp_path) as (_, bench, _):
        with pytest.raises(ConfigError, match="another bench"), SimulatedServos(config.drives):
            pass
        bench.send_signal(signal.SIGKILL)
        bench.wait(TIMEOUT)
    with SimulatedServos(config.drives) as servos:
        until(lambda: Path(servos._link).exists())
