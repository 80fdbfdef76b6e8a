"""Configuration of a drive before it is enabled; every setting is read back.

Mode 8 (cyclic synchronous position) if the drive supports it, else 7 (interpolated position), the
reaction to a lost connection, the quick stop option, position and velocity limits. The drive must
use the default units of CiA 402: positions in counts, velocities in counts per second unless
`drives.waive` has 607F.
"""

import logging
import time

from tautscope.config import DrivesConfig
from tautscope.config.drives import waiver_hint
from tautscope.dof import Motor
from tautscope.errors import ModeRefusedError, SettingRefusedError
from tautscope.hardware import cia402
from tautscope.hardware import object_dictionary as objects
from tautscope.hardware.cia402 import Mode
from tautscope.hardware.cia402_errors import mode_refused
from tautscope.hardware.drive_group import CommissionedDrive
from tautscope.hardware.fieldbus import AbsentError, Fieldbus, require_waived
from tautscope.hardware.object_dictionary import Entry
from tautscope.hardware.scale import Scale

_LOG = logging.getLogger(__name__)
CIA_402 = 402
"""Device profile number, the low 16 bits of 0x1000."""


def commission(bus: Fieldbus, config: DrivesConfig, dof: Motor) -> CommissionedDrive:
    """Configure one drive, which stays disabled.

    Raises:
        ModeRefusedError: It is no CiA 402 drive, has neither mode, or did not enter it.
        SettingRefusedError: A setting was refused or reads back differently, or the drive lacks a
            protection that is not waived.
    """
    device_type = bus.read(dof, objects.DEVICE_TYPE)
    if device_type & 0xFFFF != CIA_402:
        raise ModeRefusedError(
            bus.names[dof],
            f"its device type is 0x{device_type:08X}, not that of a CiA 402 drive",
            f"Check {dof.key}.node",
        )
    setup = _DriveSetup(bus, config, dof)
    setup.set_protections()
    setup.set_limits()
    mode = setup.enter_mode()
    _LOG.info("%s: mode %d, settings read back", bus.names[dof], mode)
    return CommissionedDrive(
        bus.names[dof],
        bus.read_or_zero(dof, objects.VENDOR_ID),
        bus.read_or_zero(dof, objects.PRODUCT_CODE),
        mode,
        setup.settings,
        tuple(setup.absent),
    )


class _DriveSetup:
    """Settings of one drive while they are written."""

    def __init__(self, bus: Fieldbus, config: DrivesConfig, dof: Motor) -> None:
        self._bus, self._config, self._dof = bus, config, dof
        self._scale = Scale(config[dof], dof)
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
        has_speed_limits = "607F" not in self._config.waive
        if has_speed_limits:
            self._set(objects.MAX_PROFILE_VELOCITY, speed)
        # A drive compares with its present set-point only: allow for the travel during the lag.
        window = axis.following_error + self._config.lag * axis.speed_limit
        self._set(objects.FOLLOWING_ERROR_WINDOW, max(1, round(window * axis.counts_per_unit)))
        self._set(objects.FOLLOWING_ERROR_TIMEOUT, round(self._config.following_timeout * 1e3))
        counts = turns = 0
        if has_speed_limits:
            counts = self._bus.read_or_zero(self._dof, objects.ENCODER_INCREMENTS)
            turns = self._bus.read_or_zero(self._dof, objects.MOTOR_REVOLUTIONS)
        if counts and turns:
            self._set(objects.MAX_MOTOR_SPEED, -(-speed * 60 * turns // counts))  # [1/min]

    def enter_mode(self) -> Mode:
        *others, last = self._modes()
        for mode in others:
            try:
                return self._enter(mode)
            except (ModeRefusedError, SettingRefusedError):
                continue
        return self._enter(last)

    def _enter(self, mode: Mode) -> Mode:
        bus, dof, config = self._bus, self._dof, self._config
        is_interpolated = mode is Mode.INTERPOLATED_POSITION
        if is_interpolated:
            self._set(objects.INTERPOLATION_SUBMODE, 0)  # linear
        if is_interpolated or config.interpolation_time:
            self._set(objects.INTERPOLATION_EXPONENT, -3)
            self._set(objects.INTERPOLATION_TIME, round(config.cycle * 1e3), required=True)
        if is_interpolated:
            for value in (0, 1):  # a command that cannot be read back
                try:
                    bus.write(dof, objects.INTERPOLATION_BUFFER_CLEAR, value)
                except AbsentError:
                    self.absent.append(str(objects.INTERPOLATION_BUFFER_CLEAR))
        self._write(objects.MODES_OF_OPERATION, mode)
        deadline = time.monotonic() + config.state_timeout
        while (shown := bus.read(dof, objects.MODE_DISPLAY)) != mode:
            if not shown and "6061" in config.waive:
                break
            if time.monotonic() > deadline:
                raise mode_refused(bus.names[dof], mode, shown)
            time.sleep(config.cycle)
        return mode

    def _modes(self) -> tuple[Mode, ...]:
        """The mode to enter; both, in this order, if the drive does not tell and that is waived."""
        name, config = self._bus.names[self._dof], self._config
        try:
            supported = self._bus.read(self._dof, objects.SUPPORTED_MODES)
        except AbsentError as error:
            require_waived(config, objects.SUPPORTED_MODES, error)
            supported = 0
        modes = (Mode.CYCLIC_SYNCHRONOUS_POSITION, Mode.INTERPOLATED_POSITION)
        for mode in modes:
            if supported & mode.supported_bit:
                return (mode,)
        if "6502" in config.waive:
            return modes
        raise ModeRefusedError(
            name,
            f"its supported modes (0x6502) are 0x{supported:08X}: neither cyclic synchronous "
            "position (8) nor interpolated position (7)",
            f"It cannot follow a stream of positions. {waiver_hint('6502')}; else use another "
            "drive or firmware",
        )

    def _set(self, entry: Entry, value: int, *, required: bool = False) -> None:
        try:
            self._write(entry, value)
            self._bus.verify(self._dof, entry, value)
        except SettingRefusedError as error:
            if required or not isinstance(error, AbsentError):
                require_waived(self._config, entry, error)
            self.absent.append(str(entry))
        else:
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
