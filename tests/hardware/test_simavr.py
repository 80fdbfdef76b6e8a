"""The Arduino sketch, compiled with Arduino's own core, in simavr: in simulated time."""

import ctypes
import shutil
from pathlib import Path

import pytest
from serial_settings import ARDUINO, compiled, require_tool, run, serial_config
from tautscope.hardware import drive_group
from tautscope.hardware.serial_line import frames, line, serial_drives
from tautscope.hardware.serial_line.frames import Request, State

CORE = Path("/usr/share/arduino/hardware/arduino/avr")
FLASH, RAM = 32_256, 2_048  # byte, of an Uno with its bootloader
CYCLE = 0.004  # s
WATCHDOG = 0.1  # s


class SimulatedUno:
    """An Uno as a port and a clock: reading lets its time pass."""

    def __init__(self, library: Path, sketch: Path) -> None:
        self.c = ctypes.CDLL(str(library))
        self.c.board_time.restype = self.c.board_last_step.restype = ctypes.c_double
        assert self.c.board_open(str(sketch).encode()) == 0
        self._received = b""

    def monotonic(self) -> float:
        return float(self.c.board_time())

    @property
    def in_waiting(self) -> int:
        return len(self._received)

    def run(self, seconds: float) -> None:
        assert self.c.board_run(round(1e6 * seconds), 0)
        self._take()

    def read(self, size: int) -> bytes:
        if not self._received:
            assert self.c.board_run(1000, 1)  # 1 ms, or to the end of a frame
            self._take()
        data, self._received = self._received[:size], self._received[size:]
        return data

    def write(self, data: bytes) -> None:
        self.c.board_write(data, len(data))

    def close(self) -> None:
        self.c.board_close()

    def _take(self) -> None:
        data = ctypes.create_string_buffer(4096)
        size = self.c.board_read(data)
        self._received += data.raw[:size]


@pytest.fixture(scope="module")
def sketch(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The sketch as the Arduino IDE builds it."""
    require_tool(shutil.which("avr-gcc") is not None, "avr-gcc (apt: gcc-avr avr-libc)")
    require_tool(CORE.is_dir(), f"{CORE} (apt: arduino-core-avr)")
    folder = tmp_path_factory.mktemp("sketch")
    source, core = folder / "sketch.cpp", CORE / "cores" / "arduino"
    sketch_file = ARDUINO / "tautscope_stepper.ino"
    source.write_text(f'#include <Arduino.h>\n#include "{sketch_file}"\n', encoding="ascii")
    common = ("-mmcu=atmega328p", "-DF_CPU=16000000L", "-DARDUINO=10819", "-Os")
    common += ("-ffunction-sections", "-fdata-sections", f"-I{core}")
    common += (f"-I{CORE / 'variants' / 'standard'}",)
    cpp = ("-std=gnu++11", "-fno-exceptions", "-fno-threadsafe-statics")
    objects = []
    for file, options in (
        (source, (*cpp, "-Wall", "-Wextra", "-Werror")),
        *((core / f"{name}.cpp", cpp) for name in ("main", "HardwareSerial", "HardwareSerial0")),
        *((core / f"{name}.cpp", cpp) for name in ("Print", "abi")),
        *((core / f"{name}.c", ("-std=gnu11",)) for name in ("wiring", "wiring_digital", "hooks")),
    ):
        objects.append(folder / f"{file.stem}.o")
        run("avr-gcc", *common, *options, "-c", file, "-o", objects[-1])
    run("avr-gcc", *common, "-Wl,--gc-sections", *objects, "-o", folder / "sketch.elf")
    return folder / "sketch.elf"


@pytest.fixture
def uno(sketch: Path, tmp_path: Path) -> SimulatedUno:
    require_tool(Path("/usr/include/simavr").is_dir(), "simavr (apt: libsimavr-dev)")
    return SimulatedUno(compiled("simavr_board.c", tmp_path, "-Wall", "-lsimavr"), sketch)


def test_sketch_fits_an_uno(sketch: Path) -> None:
    sections = [line.split() for line in run("avr-size", "-A", sketch).splitlines()]
    size = {row[0]: int(row[1]) for row in sections if row and row[0].startswith(".")}
    assert size[".text"] + size[".data"] < FLASH / 4
    assert size[".data"] + size[".bss"] < RAM / 4


def test_a_thousand_setpoints_in_order(
    uno: SimulatedUno, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of the host's own code, which times them by the Uno's clock; every step is on its pin."""
    for module in (line, serial_drives, drive_group):
        monkeypatch.setattr(module, "time", uno)
    config = serial_config(tmp_path, cycle=CYCLE, reply_timeout=0.0035, heartbeat_timeout=0.08)
    drives = serial_drives.SerialDrives(config, uno)
    drives.enable(reset_faults=False)
    steps, previous = uno.c.board_steps(), [0, 0, 0]
    moved = 0
    for number in range(1, 1001):
        began = uno.monotonic()
        # Counts of insertion, rotation, bending: forwards and back, up to 16 and 12 in a cycle.
        phase = number if number <= 500 else 1000 - number
        targets = [16 * phase, -phase, 12 * abs(phase % 40 - 20) - 240]
        feedback = drives.exchange(targets)
        assert [one.age for one in feedback] == [0, 0, 0]
        if number > 1:  # where the set-points before sent the motors
            distance = max(
                abs(one.position - at) for one, at in zip(feedback, previous, strict=True)
            )
            assert distance <= 1
        moved += sum(abs(target - at) for target, at in zip(targets, previous, strict=True))
        previous = targets
        uno.run(CYCLE - (uno.monotonic() - began))
    assert feedback[0].answers == 1001  # with that of `enable`
    uno.run(0.05)
    assert abs(uno.c.board_steps() - steps - moved) <= 3
    drives.close()


def test_watchdog_stops_the_motors_within_its_time(uno: SimulatedUno, tmp_path: Path) -> None:
    """Motors on their way over far more than the watchdog time; the last step is on the pin."""
    by_hand = SimulatedLine(uno)
    assert (
        by_hand.ask(Request.ENABLE, round(1e3 * WATCHDOG).to_bytes(2, "little")).state
        == State.ENABLED
    )
    by_hand.ask(Request.SETPOINTS, frames.setpoints([0, 0, 0]))
    uno.run(0.01)
    sent_at = uno.monotonic()
    assert (
        by_hand.ask(Request.SETPOINTS, frames.setpoints([90_000, -90_000, 100])).state
        == State.ENABLED
    )
    uno.run(0.09 - (uno.monotonic() - sent_at))
    assert by_hand.ask(Request.READ).state == State.ENABLED  # which is no set-point
    uno.run(3 * WATCHDOG)
    # The request itself takes 0.8 ms, after which the time counts.
    assert 0.95 * WATCHDOG < uno.c.board_last_step() - sent_at <= WATCHDOG + 0.8e-3
    stopped = by_hand.ask(Request.READ)
    assert stopped.state == State.SILENCE
    assert stopped.positions[0] > 900
    assert by_hand.ask(Request.READ).positions == stopped.positions


@pytest.mark.parametrize("intervals", [(15, 1), (30, 1, 1), (70, 1, 1, 6)])
def test_set_points_after_late_ones_are_no_burst(
    uno: SimulatedUno, intervals: tuple[int, ...]
) -> None:
    """At 2 steps per ms, and 10 at most, there are 4 at most in any ms; requests take one each."""
    by_hand = SimulatedLine(uno)
    by_hand.ask(Request.ENABLE, (1000).to_bytes(2, "little"))
    for number, interval in enumerate([8] * 20 + [*intervals] + [8] * 20):
        target = 16 * min(number, 39)  # the last intervals are for rest
        by_hand.ask(Request.SETPOINTS, frames.setpoints([target, 0, 0]))
        for _ in range(interval - 1):
            before = uno.c.board_steps()
            uno.run(1e-3)
            assert uno.c.board_steps() - before <= 4
    assert by_hand.ask(Request.READ).positions[0] == target


class SimulatedLine:
    """Requests by hand."""

    def __init__(self, uno: SimulatedUno) -> None:
        self._uno = uno
        self._number = 0
        uno.run(0.01)  # setup()

    def _answer(self) -> bytes:
        data = b""
        while not data.endswith(b"\0"):
            data += self._uno.read(100)
        return data[:-1]

    def ask(self, kind: Request, body: bytes = b"") -> frames.Status:
        self._number += 1
        self._uno.write(frames.request(kind, self._number, body))
        message = frames.decode(self._answer())
        assert message is not None
        status = frames.read_status(message, 3)
        assert status is not None
        assert status.number == self._number
        return status
