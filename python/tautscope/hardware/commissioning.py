"""Configuration of a drive before it is enabled; every setting is read back.

Mode 8 (cyclic synchronous position) if the drive supports it, else 7 (interpolated position), the
reaction to a lost connection, the quick stop option, position and velocity limits. The drive must
use the default units of CiA 402: positions in counts, velocities in counts per second.
"""

from __future__ import annotations

import logging
import time

from tautscope.config import DrivesConfig
from tautscope.dof import Dof
from tautscope.errors import ModeRefusedError, SettingRefusedError
from tautscope.hardware import cia402
from tautscope.hardware import object_dictionary as objects
from tautscope.hardware.cia402 import Mode
from tautscope.hardware.drive_group import CommissionedDrive
from tautscope.hardware.fieldbus import AbsentError, Fieldbus, verify_setting
from tautscope.hardware.object_dictionary import Entry
from tautscope.hardware.scale import Scale

_LOG = logging.getLogger(__name__)
WAIVABLE = ("6007", "605A", "607D")
"""Objects that `drives.waive` may name."""
CIA_402 = 402
"""Device profile number, the low 16 bits of 0x1000."""


def commission(bus: Fieldbus, config: DrivesConfig, dof: Dof) -> CommissionedDrive:
    """Configure one drive, which stays disabled.

    Raises:
        ModeRefusedError: It is no CiA 402 drive, has neither mode, or did not enter it.
        SettingRefusedError: A setting was refused or reads back differently, or the drive lacks a
            protection that is not waived.
        DriveError: As `tautscope.hardware.fieldbus.Fieldbus`.
    """
    device_type = bus.read(dof, objects.DEVICE_TYPE)
    if device_type & 0xFFFF != CIA_402:
        raise ModeRefusedError(
            bus.name(dof),
            f"its device type is 0x{device_type:08X}, not that of a CiA 402 drive",
            f"Check drives.{dof.label}.node",
        )
    setup = _DriveSetup(bus, config, dof)
    setup.set_protections()
    setup.set_limits()
    mode = setup.enter_mode()
    _LOG.info("%s: mode %d, settings read back", bus.name(dof), mode)
    return CommissionedDrive(
        bus.name(dof),
        setup.read_or(objects.VENDOR_ID, 0),
        setup.read_or(objects.PRODUCT_CODE, 0),
        mode,
        setup.settings,
        tuple(setup.absent),
    )


class _DriveSetup:
    """Settings of one drive while they are written."""

    def __init__(self, bus: Fieldbus, config: DrivesConfig, dof: Dof) -> None:
        self._bus, self._config, self._dof = bus, config, dof
        self._scale = Scale(config[dof], dof.label)
        self.settings: dict[str, int] = {}
        self.absent: list[str] = []

    def set_protections(self) -> None:
        config = self._config
        hold = config.after_quick_stop == "hold"
        option = cia402.QUICK_STOP_HOLD if hold else cia402.QUICK_STOP_RELEASE
        # On EtherCAT the process data watchdog replaces 0x6007.
        on_can = config.protocol == "canopen"
        self._set(
            objects.ABORT_CONNECTION_OPTION, cia402.ABORT_CONNECTION_QUICK_STOP, required=on_can
        )
        self._set(objects.QUICK_STOP_OPTION_CODE, option, required=True)

    def set_limits(self) -> None:
        axis, speed = self._config[self._dof], self._scale.speed_counts()
        lower, upper = self._scale.travel_counts()
        self._set(objects.MIN_POSITION_LIMIT, lower, required=True)
        self._set(objects.MAX_POSITION_LIMIT, upper, required=True)
        self._set(objects.MAX_PROFILE_VELOCITY, speed)
        # A drive compares with its present set-point only: allow for the travel during the lag.
        window = axis.following_error + self._config.lag * axis.speed_limit
        self._set(objects.FOLLOWING_ERROR_WINDOW, max(1, round(window * axis.counts_per_unit)))
        self._set(objects.FOLLOWING_ERROR_TIMEOUT, round(self._config.following_timeout * 1e3))
        counts = self.read_or(objects.ENCODER_INCREMENTS, 0)
        turns = self.read_or(objects.MOTOR_REVOLUTIONS, 0)
        if counts and turns:
            self._set(objects.MAX_MOTOR_SPEED, -(-speed * 60 * turns // counts))  # [1/min]

    def enter_mode(self) -> Mode:
        bus, dof = self._bus, self._dof
        mode = self._supported_mode()
        if mode is Mode.INTERPOLATED_POSITION:
            self._set(objects.INTERPOLATION_SUBMODE, 0)  # linear
            self._set(objects.INTERPOLATION_EXPONENT, -3)
            self._set(objects.INTERPOLATION_TIME, round(self._config.cycle * 1e3), required=True)
            for value in (0, 1):
                self._clear_buffer(value)
        bus.write(dof, objects.MODES_OF_OPERATION, mode)
        deadline = time.monotonic() + self._config.state_timeout
        while (shown := bus.read(dof, objects.MODE_DISPLAY)) != mode:
            if time.monotonic() > deadline:
                raise ModeRefusedError(
                    bus.name(dof),
                    f"it did not enter mode {mode.value}: mode display (0x6061) is {shown}",
                    f"Disable it, and look up in its manual what mode {mode.value} requires",
                )
            time.sleep(self._config.cycle)
        return mode

    def read_or(self, entry: Entry, default: int) -> int:
        try:
            return self._bus.read(self._dof, entry)
        except AbsentError:
            return default

    def _supported_mode(self) -> Mode:
        supported = self._bus.read(self._dof, objects.SUPPORTED_MODES)
        for mode in (Mode.CYCLIC_SYNCHRONOUS_POSITION, Mode.INTERPOLATED_POSITION):
            if supported & mode.supported_bit:
                return mode
        raise ModeRefusedError(
            self._bus.name(self._dof),
            f"its supported modes (0x6502) are 0x{supported:08X}: neither cyclic synchronous "
            "position (8) nor interpolated position (7)",
            "It cannot follow a stream of positions; use another drive or firmware",
        )

    def _clear_buffer(self, value: int) -> None:
        """Write 0x60C4:6, a command that cannot be read back."""
        try:
            self._bus.write(self._dof, objects.INTERPOLATION_BUFFER_CLEAR, value)
        except AbsentError:
            self.absent.append(str(objects.INTERPOLATION_BUFFER_CLEAR))

    def _set(self, entry: Entry, value: int, *, required: bool = False) -> None:
        bus, dof = self._bus, self._dof
        try:
            self._write(entry, value)
        except AbsentError:
            index = f"{entry.index:04X}"
            if required and index not in self._config.waive:
                remedy = "The drive cannot be used"
                if index in WAIVABLE:
                    remedy = f"If another protection replaces it, add {index} to drives.waive"
                raise SettingRefusedError(
                    bus.name(dof), f"it does not have {entry}", remedy
                ) from None
            self.absent.append(str(entry))
            return
        verify_setting(bus, dof, entry, value)
        self.settings[str(entry)] = value

    def _write(self, entry: Entry, value: int) -> None:
        try:
            self._bus.write(self._dof, entry, value)
        except AbsentError:
            raise
        except SettingRefusedError:
            # A read-only object that already holds the value is fine.
            if self._bus.read(self._dof, entry) != value:
                raise
