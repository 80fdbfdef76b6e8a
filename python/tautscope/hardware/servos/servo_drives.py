"""Servos on a serial line: a `tautscope.hardware.drive_group.DriveGroup`.

Each cycle is one sync write of the set-points and one sync read of the positions; each answer says
whether its servo has a fault. A servo in position mode holds its last set-point. Of the two
families only Dynamixel stops by itself when packets are missing (bus watchdog,
`heartbeat_timeout`); docs/hardware.md says what moves after the end of the host.
"""

import time
from contextlib import suppress

from tautscope.config import DrivesConfig
from tautscope.dof import Motor
from tautscope.errors import DriveError, EmergencyError, StateError
from tautscope.hardware.drive_group import CommissionedDrive, DriveGroup, DriveStatus, Feedback
from tautscope.hardware.servos.families import FAMILIES, Register
from tautscope.hardware.servos.line import NoAnswerError, ServoLine
from tautscope.hardware.servos.servo import Servo

_WATCHDOG_UNIT = 0.02
"""Unit of the bus watchdog [s]."""


class ServoDrives(DriveGroup):
    """Servos on a serial line.

    Raises:
        MissingExtraError: The extra ``servo`` is not installed.
        BusError: The port cannot be opened.
    """

    def __init__(self, config: DrivesConfig) -> None:
        self._family = family = FAMILIES[config.protocol]
        self._line = ServoLine(config, family)
        self._servos = [Servo(config, dof, self._line) for dof in config.all_motors]
        super().__init__(config, [servo.name for servo in self._servos], self._line.close)
        self._ids = [servo.id for servo in self._servos]
        self._goals = [0] * len(config.all_motors)
        self._has_lost_answers = False

    def status(self, dof: Motor) -> DriveStatus:
        """See `Servo.status`."""
        return self._servos[dof].status()

    def may_move_if_set(self, dof: Motor) -> bool:
        """Whether its torque is on."""
        return bool(self._servos[dof].read(self._family.torque))

    def commission(self, dof: Motor) -> CommissionedDrive:
        """See `Servo.commission`."""
        return self._servos[dof].commission()

    def read_positions(self) -> list[int]:
        """See `DriveGroup.read_positions`."""
        return [servo.read(self._family.position) for servo in self._servos]

    def start(self, positions: list[int]) -> None:
        """See `DriveGroup.start`."""
        self._goals = positions
        self._line.set_timeout(self._config.reply_timeout)
        super().start(positions)

    def probe(self) -> list[Feedback]:
        """Read all servos once."""
        self._receive()
        return self._feedback

    def enable(self, *, reset_faults: bool) -> list[Feedback]:
        """See `DriveGroup.enable`."""
        family = self._family
        self._line.set_timeout(self._config.request_timeout)
        for dof, servo in zip(self._config.all_motors, self._servos, strict=True):
            if faults := servo.read(family.faults):
                if not reset_faults:
                    raise StateError(servo.name, *servo.fault(faults))
                self._goals[dof] = servo.reset_fault(self._goals[dof])
        # A stop while they are being enabled holds them there, not where they were before a reset.
        super().start(self._goals)
        for servo, goal in zip(self._servos, self._goals, strict=True):
            self._was_enabled = self._is_moving = True
            servo.may_search = False
            servo.write(family.goal, goal)
            servo.write(family.torque, 1)
            if not servo.read(family.torque):
                raise StateError(
                    servo.name, "its torque stays off", "Check its supply; power-cycle it"
                )
            if family.watchdog is not None:
                units = -(-self._config.heartbeat_timeout // _WATCHDOG_UNIT)
                servo.write(family.watchdog, max(1, int(units)))
        self.start(self._goals)
        return self.exchange(self._goals)

    def exchange(self, targets: list[int]) -> list[Feedback]:
        """Send the set-points, read the positions, check the faults.

        Raises:
            StateError: More than `heartbeat_timeout` passed since the last set-point.
            EmergencyError: A servo reports a fault.
            BusError: The port is lost.
        """
        self._check_pause(f"servos on {self._config.channel}")
        self._goals = targets
        with suppress(NoAnswerError):  # lost like a set-point on its way; `_receive` counts silence
            self._line.write_all(dict(zip(self._ids, targets, strict=True)), self._family.goal)
        self._receive()
        return self._feedback

    def _stop(self) -> list[str]:
        """Hold each motor where it was in the last cycle, or release it, as `after_quick_stop`."""
        if self._is_unconfirmed:  # they may have gone on since the first attempt
            with suppress(DriveError):
                self._receive()
        unconfirmed = self._command_until(
            self._family.goal, [one.position for one in self._feedback]
        )
        if self._config.after_quick_stop == "release" and not unconfirmed:
            return self._switch_off()
        return unconfirmed

    def _switch_off(self) -> list[str]:
        self._await_rest(self.probe)
        return self._command_until(self._family.torque, [0] * len(self._servos))

    def remark(self) -> str:
        """Which servos have no torque: a restarted one shows by its following error only."""
        if not self._was_enabled or self._config.after_quick_stop == "release":
            return ""
        names = []
        for servo in self._servos:
            with suppress(DriveError, NoAnswerError):
                if not self._line.read(servo.id, self._family.torque)[0]:
                    names.append(servo.name)
        if not names:
            return ""
        return (
            f"{'; '.join(names)}: without torque. If it restarted, it has forgotten its turns: "
            "check its supply, and where it is (tautscope doctor)"
        )

    def _command_until(self, register: Register, values: list[int]) -> list[str]:
        """Repeat a sync write until each servo has the value; names of those that do not."""
        pending = set(self._config.all_motors)
        deadline = time.monotonic() + self._config.state_timeout
        try:
            self._line.set_timeout(self._config.reply_timeout)
            while pending and time.monotonic() < deadline:
                with suppress(NoAnswerError):  # the next round repeats it
                    # Goals are read-only once the watchdog has tripped.
                    if self._family.watchdog is not None:
                        self._line.write_all(dict.fromkeys(self._ids, 0), self._family.watchdog)
                    self._line.write_all(dict(zip(self._ids, values, strict=True)), register)
                for dof in sorted(pending):
                    try:
                        value, _ = self._line.read(self._ids[dof], register)
                    except NoAnswerError:
                        continue
                    if value == values[dof]:
                        pending.discard(dof)
        except DriveError:
            pass  # the port is lost
        return [self.names[dof] for dof in sorted(pending)]

    def _receive(self) -> None:
        """Read all servos with one packet; one by one in the cycle after one did not answer."""
        was_lossy, self._has_lost_answers = self._has_lost_answers, False
        answers: list[tuple[int, int] | None] = []
        try:
            if was_lossy:
                answers = [self._try_read(servo) for servo in self._ids]
            else:
                answers += self._line.read_all(self._ids, self._family.position)
        except NoAnswerError:
            answers = [None] * len(self._config.all_motors)
        now = time.monotonic()
        for dof, answer in zip(self._config.all_motors, answers, strict=True):
            one = self._feedback[dof]
            if answer is None:
                self._has_lost_answers = True
                one.age, one.silence = one.age + 1, now - one.answered_at
                continue
            one.age, one.silence, one.answered_at = 0, 0.0, now
            one.answers += 1
            one.position = answer[0]
        for dof, answer in zip(self._config.all_motors, answers, strict=True):
            if answer is not None and self._is_moving:
                self._check_faults(dof, answer[1])

    def _try_read(self, servo: int) -> tuple[int, int] | None:
        try:
            return self._line.read(servo, self._family.position)
        except NoAnswerError:
            return None

    def _check_faults(self, dof: Motor, error: int) -> None:
        faults, servo = error, self._servos[dof]
        if self._family.alert:
            if not error & self._family.alert:
                return
            faults = servo.read(self._family.faults)
        if faults:
            raise EmergencyError(servo.name, *servo.fault(faults))
