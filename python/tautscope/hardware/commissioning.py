"""What a drive is told once, before it is ever enabled; all of it is read back.

Mode 8 (cyclic synchronous position) if it has it, else 7 (interpolated position); what it does when
it loses us and on quick stop; limits of travel and speed. The units it must be set to are those of
the standard's defaults: positions in counts, speeds in counts per second.
"""

from __future__ import annotations

import time
from dataclasses import dataclass

from tautscope.config import DrivesConfig
from tautscope.dof import Dof
from tautscope.errors import ModeRefusedError, SettingRefusedError
from tautscope.hardware import cia402
from tautscope.hardware import object_dictionary as objects
from tautscope.hardware.cia402 import Mode, Scale
from tautscope.hardware.link import AbsentError, Link
from tautscope.hardware.object_dictionary import Entry

WAIVABLE = ("6007", "605A", "607D")
"""What `drives.waive` may name."""
CIA_402 = 402
"""Device profile number, the low half of 0x1000."""


@dataclass(frozen=True, slots=True)
class Commissioned:
    """What one drive is and how it was set; for whoever inspects a rig, and for recordings.

    Attributes:
        name: The drive as a person finds it.
        vendor, product: From its identity object, 0x1018; 0 where it has none.
        mode: The mode it took.
        settings: Object and value as read back.
        absent: Objects it does not have.
    """

    name: str
    vendor: int
    product: int
    mode: Mode
    settings: dict[str, int]
    absent: tuple[str, ...]


def commission(link: Link, config: DrivesConfig, dof: Dof) -> Commissioned:
    """Set one drive, which stays disabled.

    Raises:
        ModeRefusedError: It is no CiA 402 drive, has neither mode, or did not take it.
        SettingRefusedError: A setting was refused or reads back differently, or the drive lacks a
            protection that was not waived.
        DriveError: As `tautscope.hardware.link.Link`.
    """
    kind = link.read(dof, objects.DEVICE_TYPE)
    if kind & 0xFFFF != CIA_402:
        raise ModeRefusedError(
            link.name(dof),
            f"its device type is 0x{kind:08X}, not that of a CiA 402 drive",
            f"Check drives.{dof.label}.node",
        )
    visit = _Visit(link, config, dof)
    visit.protections()
    visit.limits()
    mode = visit.mode()
    return Commissioned(
        link.name(dof),
        visit.read_or(objects.VENDOR, 0),
        visit.read_or(objects.PRODUCT, 0),
        mode,
        visit.settings,
        tuple(visit.absent),
    )


class _Visit:
    """One drive while it is being set."""

    def __init__(self, link: Link, config: DrivesConfig, dof: Dof) -> None:
        self._link, self._config, self._dof = link, config, dof
        self._scale = Scale(config[dof], dof.label)
        self.settings: dict[str, int] = {}
        self.absent: list[str] = []

    def protections(self) -> None:
        config = self._config
        hold = config.after_quick_stop == "hold"
        option = cia402.QUICK_STOP_HOLD if hold else cia402.QUICK_STOP_RELEASE
        # On EtherCAT the watchdog of the process data does what 0x6007 does on CAN.
        on_can = config.protocol == "canopen"
        self._set(objects.ON_LOSS, cia402.ON_LOSS_QUICK_STOP, needed=on_can)
        self._set(objects.QUICK_STOP_OPTION, option, needed=True)

    def limits(self) -> None:
        axis, speed = self._config[self._dof], self._scale.speed_counts()
        lower, upper = self._scale.travel_counts()
        self._set(objects.LEAST_POSITION, lower, needed=True)
        self._set(objects.LARGEST_POSITION, upper, needed=True)
        self._set(objects.PROFILE_SPEED_LIMIT, speed)
        # A drive compares with its present set-point: it must grant the way of a lag on top.
        window = axis.following_error + self._config.lag * axis.speed_limit
        self._set(objects.FOLLOWING_WINDOW, max(1, round(window * axis.counts_per_unit)))
        self._set(objects.FOLLOWING_TIME, round(self._config.following_timeout * 1e3))
        counts = self.read_or(objects.ENCODER_COUNTS, 0)
        turns = self.read_or(objects.ENCODER_TURNS, 0)
        if counts and turns:
            self._set(objects.MOTOR_SPEED_LIMIT, -(-speed * 60 * turns // counts))  # [1/min]

    def mode(self) -> Mode:
        link, dof = self._link, self._dof
        mode = self._supported_mode()
        if mode is Mode.INTERPOLATED_POSITION:
            self._set(objects.INTERPOLATION_SUBMODE, 0)  # linear
            self._set(objects.INTERPOLATION_EXPONENT, -3)
            self._set(objects.INTERPOLATION_TIME, round(self._config.cycle * 1e3), needed=True)
            for value in (0, 1):
                self._clear_buffer(value)
        link.write(dof, objects.MODE, mode)
        deadline = time.monotonic() + self._config.state_timeout
        while (shown := link.read(dof, objects.MODE_DISPLAY)) != mode:
            if time.monotonic() > deadline:
                raise ModeRefusedError(
                    link.name(dof),
                    f"mode {mode.value} was asked for, its display (0x6061) says {shown}",
                    f"Disable it, and see its manual for what mode {mode.value} needs to be set",
                )
            time.sleep(self._config.cycle)
        return mode

    def read_or(self, entry: Entry, default: int) -> int:
        try:
            return self._link.read(self._dof, entry)
        except AbsentError:
            return default

    def _supported_mode(self) -> Mode:
        supported = self._link.read(self._dof, objects.SUPPORTED_MODES)
        for mode in (Mode.CYCLIC_SYNCHRONOUS_POSITION, Mode.INTERPOLATED_POSITION):
            if supported & mode.supported_bit:
                return mode
        raise ModeRefusedError(
            self._link.name(self._dof),
            f"its supported modes (0x6502) are 0x{supported:08X}: neither cyclic synchronous "
            "position (8) nor interpolated position (7)",
            "Such a drive cannot follow streamed positions; use another, or other firmware",
        )

    def _clear_buffer(self, value: int) -> None:
        """A command rather than a value; there is nothing to read back."""
        try:
            self._link.write(self._dof, objects.BUFFER_CLEAR, value)
        except AbsentError:
            self.absent.append(str(objects.BUFFER_CLEAR))

    def _set(self, entry: Entry, value: int, *, needed: bool = False) -> None:
        link, dof = self._link, self._dof
        try:
            self._write(entry, value)
        except AbsentError:
            index = f"{entry.index:04X}"
            if needed and index not in self._config.waive:
                remedy = "Such a drive cannot be used"
                if index in WAIVABLE:
                    remedy = f"If another protection replaces it, add {index} to drives.waive"
                raise SettingRefusedError(
                    link.name(dof), f"it does not have {entry}", remedy
                ) from None
            self.absent.append(str(entry))
            return
        found = link.read(dof, entry)
        if found != value:
            raise SettingRefusedError(
                link.name(dof),
                f"{entry} was set to {value} and reads back {found}",
                "See its manual for the values it takes, and when",
            )
        self.settings[str(entry)] = value

    def _write(self, entry: Entry, value: int) -> None:
        try:
            self._link.write(self._dof, entry, value)
        except AbsentError:
            raise
        except SettingRefusedError:
            # A value that is fixed in the drive and is the right one needs no writing.
            if self._link.read(self._dof, entry) != value:
                raise
