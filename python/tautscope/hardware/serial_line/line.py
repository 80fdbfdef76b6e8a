"""A serial port with a microcontroller: requests, and the answers to them."""

import sys
import time
from typing import Any

from tautscope.config import DrivesConfig
from tautscope.errors import BusError
from tautscope.extras import require_extras
from tautscope.hardware.serial_line import frames
from tautscope.hardware.serial_line.frames import Request

_WAIT = 1e-3
"""How long a read waits for the first byte [s]."""
_WRITE_TIMEOUT = 0.1
"""How long the port may take no byte [s]."""


def open_port(config: DrivesConfig) -> Any:
    """Open the port, which no other program may have.

    Raises:
        MissingExtraError: The library is not installed.
        BusError: The port cannot be opened, or another program has it.
    """
    require_extras("A serial line", ["hardware"])
    import serial  # noqa: PLC0415

    try:
        port = serial.Serial(
            config.channel,
            config.bitrate,
            timeout=_WAIT,
            write_timeout=_WRITE_TIMEOUT,
            exclusive=True if sys.platform != "win32" else None,
        )
    except (OSError, ValueError) as error:
        raise BusError(
            f"microcontroller on {config.channel}",
            f"the port cannot be opened: {error}",
            "Check drives.channel (ls /dev/serial/by-id), the cable, that no other program has "
            "the port, and that you may use it (on Linux: group dialout)",
        ) from None
    if sys.platform != "win32":
        _keep_running(port.fileno())
    return port


def _keep_running(file: int) -> None:
    """Leave DTR on when the port is closed: an Arduino restarts each time it is switched on."""
    import termios  # noqa: PLC0415

    attributes = termios.tcgetattr(file)
    attributes[2] &= ~termios.HUPCL
    termios.tcsetattr(file, termios.TCSANOW, attributes)


class SerialLine:
    """Requests and answers on a `serial.Serial`, which is closed with it.

    Every method raises `BusError` if the port is lost.
    """

    def __init__(self, port: Any, channel: str) -> None:
        self._port, self.name = port, f"microcontroller on {channel}"
        self._buffer = bytearray()
        self._number = 0

    def send(self, kind: Request, body: bytes = b"") -> int:
        """Send a request; its number. A 0 before it ends what the line may have left."""
        self._number = self._number + 1 & 0xFFFF
        try:
            self._port.write(b"\0" + frames.request(kind, self._number, body))
        except OSError as error:
            raise self._lost(error) from None
        return self._number

    def receive(self, number: int, timeout: float) -> list[bytes]:
        """Wait for the answer to a request; all intact messages until then or the timeout [s]."""
        deadline, answers = time.monotonic() + timeout, list[bytes]()
        while not (answers and frames.number_of(answers[-1]) == number):
            if time.monotonic() >= deadline:
                break
            try:
                self._buffer += self._port.read(max(1, self._port.in_waiting))
            except OSError as error:
                raise self._lost(error) from None
            answers += frames.take_messages(self._buffer)
        return answers

    def close(self) -> None:
        """Release the port; a second call does nothing."""
        self._port.close()

    def _lost(self, error: OSError) -> BusError:
        return BusError(
            self.name,
            f"the connection is lost: {error}",
            "Check the cable and the microcontroller's supply, then start again",
        )
