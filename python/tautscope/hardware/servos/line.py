"""A serial line of servos, through `rustypot`, with the errors of this package."""

import re
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from functools import cached_property
from pathlib import Path
from typing import Any

from tautscope.config import DrivesConfig
from tautscope.errors import BusError, SettingRefusedError
from tautscope.extras import require_extras
from tautscope.hardware.servos.families import Family, Register

_IDS = range(1, 21)
"""Ids that a search asks."""
_LOST = re.compile("input/output|broken pipe|no such device|bad file|not configured", re.I)
"""Errors of the operating system when a serial adapter is gone."""
_FAILURES = (OSError, RuntimeError, ValueError)
"""Errors of `rustypot`."""
_REFUSALS = {
    1: "it could not process the packet",
    2: "unknown instruction",
    3: "wrong checksum",
    4: "value out of its range",
    5: "wrong length",
    6: "value beyond its limit",
    7: "read-only, or stored while the torque is on",
}
"""Error numbers of Dynamixel, protocol 2.0."""


class NoAnswerError(Exception):
    """A servo did not answer within the timeout."""


class ServoLine:
    """A serial line of servos.

    Every method raises `NoAnswerError` if a servo does not answer or the port does not take the
    packet in time, and `BusError` if the port is lost.
    """

    def __init__(self, config: DrivesConfig, family: Family) -> None:
        require_extras("Servos", ["servo"])
        import rustypot  # noqa: PLC0415

        self._config, self._family = config, family
        make = getattr(rustypot, family.controller)
        try:
            self._port: Any = make(config.channel, config.bitrate, config.request_timeout)
        except _FAILURES as error:
            raise BusError(
                f"servos on {config.channel}",
                f"the port cannot be opened: {error}",
                "Check drives.channel (ls /dev/serial/by-id), the cable, that no other program has "
                "the port, and that you may use it (on Linux: group dialout)",
            ) from None

    def set_timeout(self, timeout: float) -> None:
        """Set the timeout of each answer [s]."""
        self._port.set_timeout(timeout)

    def read(self, servo: int, register: Register) -> tuple[int, int]:
        """Read from one servo: value, and the error of its answer."""
        read = self._port.read_raw_data_with_error
        data, error = self._transfer(read, servo, register.address, register.size)
        return register.decode(bytes(data)), error

    def write(self, servo: int, register: Register, value: int) -> int:
        """Write to one servo; the error of its answer.

        Raises:
            SettingRefusedError: It refused the value, or the value does not fit.
        """
        try:
            data = list(register.encode(value))
        except OverflowError:
            what, remedy = f"{register} cannot hold {value}", f"It has {register.size} bytes"
            raise SettingRefusedError(f"servo {servo}", what, remedy) from None
        write = self._port.write_raw_data_with_error
        error: int = self._transfer(write, servo, register.address, data)
        refusal = error & ~self._family.alert if self._family.alert else 0
        if refusal:
            raise SettingRefusedError(
                f"servo {servo}",
                f"it refused {register} = {value}: {_REFUSALS.get(refusal, f'error {refusal}')}",
                "Look up in its manual which values it accepts, and in which state",
            )
        return error

    def read_all(self, servos: Sequence[int], register: Register) -> list[tuple[int, int]]:
        """Read from several servos with one packet (sync read): values, and the errors."""
        read = self._port.sync_read_raw_data_with_error
        answers = self._transfer(read, list(servos), register.address, register.size)
        return [(register.decode(bytes(data)), error) for data, error in answers]

    def write_all(self, values: Mapping[int, int], register: Register) -> None:
        """Write to several servos with one packet (sync write), which none answers."""
        data = [list(register.encode(value)) for value in values.values()]
        self._transfer(self._port.sync_write_raw_data, list(values), register.address, data)

    def reboot(self, servo: int) -> None:
        """Restart a servo, which forgets its turns and its settings that are not stored."""
        self._transfer(self._port.reboot, servo)

    @cached_property
    def found(self) -> str:
        """The servos that answer, in words: ids 1 to 20, at the first bit rate with an answer.

        They are searched once, which takes seconds.
        """
        rates = dict.fromkeys((self._config.bitrate, *self._family.rates))
        try:
            for rate in rates:
                with suppress(*_FAILURES):
                    self._port.set_baudrate(rate)
                    found = sorted(self._port.scan(_IDS))
                    if found:
                        return f"ids {', '.join(map(str, found))} answer at {rate} bit/s"
        finally:
            with suppress(*_FAILURES):
                self._port.set_baudrate(self._config.bitrate)
        tried = ", ".join(map(str, rates))
        return f"none of ids {_IDS[0]} to {_IDS[-1]} answers at {tried} bit/s"

    def close(self) -> None:
        """Release the port; a second call does nothing."""
        self._port.close()

    def _transfer(self, transfer: Callable[..., Any], *arguments: Any) -> Any:
        try:
            return transfer(*arguments)
        except _FAILURES as error:
            if Path(self._config.channel).exists() and not _LOST.search(str(error)):
                raise NoAnswerError(str(error)) from None  # late, lost or damaged
            raise BusError(
                f"servos on {self._config.channel}",
                f"the connection is lost: {error}",
                "Check the cable and the adapter, then start again",
            ) from None
