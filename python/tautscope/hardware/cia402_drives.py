"""CiA 402 drives: state transitions from enabling over set-points to quick stop."""

import time
from collections.abc import Callable
from dataclasses import replace

from tautscope.config import DrivesConfig
from tautscope.config.drives import waiver_hint
from tautscope.dof import Motor
from tautscope.errors import DriveError, StateError
from tautscope.hardware import cia402
from tautscope.hardware import object_dictionary as objects
from tautscope.hardware.cia402 import Mode, State
from tautscope.hardware.cia402_errors import ignores_setpoints, state_error, transition_error
from tautscope.hardware.commissioning import commission
from tautscope.hardware.drive_group import (
    RESET,
    CommissionedDrive,
    DriveGroup,
    DriveStatus,
    Feedback,
)
from tautscope.hardware.fieldbus import Fieldbus

MODES = {
    1: "profile position",
    2: "velocity",
    3: "profile velocity",
    4: "torque",
    6: "homing",
    7: "interpolated position",
    8: "cyclic synchronous position",
    9: "cyclic synchronous velocity",
    10: "cyclic synchronous torque",
}
"""Modes of operation of CiA 402; mode n is bit n - 1 of 0x6502."""
CONFIRMATIONS = 2
"""Consecutive answers that confirm a state; the first may predate the command."""


class Cia402Drives(DriveGroup):
    """CiA 402 drives on an open bus, which is closed with them; a `DriveGroup`."""

    def __init__(self, config: DrivesConfig, bus: Fieldbus) -> None:
        super().__init__(config, bus.names, bus.close)
        self._bus = bus
        self._modes: dict[Motor, Mode] = {}
        self._controlwords = [cia402.DISABLE_VOLTAGE] * len(config.all_motors)
        self._targets = [0] * len(config.all_motors)

    @property
    def pending(self) -> int:
        """See `DriveGroup.pending`."""
        # A drive samples its position when the set-point arrives; buffered set-points act later.
        is_buffered = Mode.INTERPOLATED_POSITION in self._modes.values()
        return 1 + (self._config.lead_points if is_buffered else 0)

    def serial_number(self, dof: Motor) -> str:
        """The serial number in the identity object (0x1018:4)."""
        number = self._bus.read_or_zero(dof, objects.SERIAL_NUMBER)
        return f"{number:08X}" if number else ""

    def status(self, dof: Motor) -> DriveStatus:
        """Read state, position, supported modes and identity."""
        supported = self._bus.read_or_zero(dof, objects.SUPPORTED_MODES)
        state = cia402.state_of(self._bus.read(dof, objects.STATUSWORD))
        position = self._bus.read(dof, objects.POSITION_ACTUAL)
        vendor = self._bus.read_or_zero(dof, objects.VENDOR_ID)
        modes = [number for number in MODES if supported >> (number - 1) & 1]
        problem = ""
        if state in (State.FAULT, State.FAULT_REACTION):
            code = cia402.error_text(self._bus.read_or_zero(dof, objects.ERROR_CODE))
            problem = f"Find the cause: look error code {code} up in its manual, then {RESET}"
        elif state is State.OPERATION_ENABLED:
            problem = "It is enabled: end the program that commands it, or power-cycle it"
        elif not {7, 8} & set(modes) and "6502" not in self._config.waive:
            problem = (
                "It does not say that it can follow a stream of positions (0x6502). "
                f"{waiver_hint('6502')}; else use another drive or firmware"
            )
        return DriveStatus(
            position,
            f"vendor 0x{vendor:X}; {state.value if state else 'unknown state'}; modes "
            + (", ".join(f"{number} {MODES[number]}" for number in modes) or "unknown"),
            problem,
            self.serial_number(dof),
            {"vendor": vendor, "state": state.value if state else None, "modes": modes},
        )

    def commission(self, dof: Motor) -> CommissionedDrive:
        """See `tautscope.hardware.commissioning.commission`."""
        drive = commission(self._bus, self._config, dof)
        self._modes[dof] = Mode(drive.mode)
        return drive

    def configure(self) -> None:
        """See `Fieldbus.configure`."""
        self._bus.configure(self._modes)

    def read_positions(self) -> list[int]:
        """See `DriveGroup.read_positions`."""
        return [self._bus.read(dof, objects.POSITION_ACTUAL) for dof in self._config.all_motors]

    def start(self, positions: list[int]) -> None:
        """See `DriveGroup.start`."""
        self._targets = positions
        self._bus.start()

    def probe(self) -> list[Feedback]:
        """Run one cycle with the controlword quick stop."""
        return self._bus.exchange([cia402.QUICK_STOP] * len(self._targets), self._targets)

    def exchange(self, targets: list[int]) -> list[Feedback]:
        """Run one cycle with new target positions [counts], and check the states.

        Raises:
            StateError: A drive left operation enabled or its mode, or ignores set-points.
        """
        self._targets = targets
        self._cycle()
        for dof in self._config.all_motors:
            self._check_state(dof, self._feedback[dof])
        return self._feedback

    def enable(self, *, reset_faults: bool) -> list[Feedback]:
        """See `DriveGroup.enable`; `state_timeout` is for each state."""
        self._was_enabled = True
        # Not those of an earlier run, which would enable drives that quick stop holds.
        self._controlwords = [cia402.DISABLE_VOLTAGE] * len(self._targets)
        if reset_faults:
            self._run_transition(self._reset_fault)
        self._run_transition(self._enable)
        if Mode.INTERPOLATED_POSITION in self._modes.values():
            for _ in range(self._config.lead_points):
                self._paced_cycle()
        self._run_transition(self._start_following)
        return self._feedback

    def _stop(self) -> list[str]:
        return self._command_until(cia402.QUICK_STOP, cia402.STOPPED_STATES)

    def _switch_off(self) -> list[str]:
        self._await_rest(lambda: self._bus.broadcast(cia402.QUICK_STOP, self._targets))
        return self._command_until(cia402.DISABLE_VOLTAGE, cia402.POWER_OFF_STATES)

    def _command_until(self, controlword: int, states: frozenset[State]) -> list[str]:
        """Repeat a controlword until all drives confirm a state; names of those that do not."""
        confirmed = [0] * len(self._targets)
        deadline = time.monotonic() + self._config.state_timeout
        while min(confirmed) < CONFIRMATIONS and time.monotonic() < deadline:
            try:
                feedback = self._bus.broadcast(controlword, self._targets)
            except DriveError:
                break  # the bus is lost
            for dof, one in enumerate(feedback):
                is_there = not one.age and cia402.state_of(one.statusword) in states
                confirmed[dof] = confirmed[dof] + 1 if is_there else 0
            if not all(confirmed):
                time.sleep(self._config.cycle / 4)
        pending = [dof for dof in self._config.all_motors if confirmed[dof] < CONFIRMATIONS]
        if pending:
            self._bus.stop_communication(pending)
        return [self.names[dof] for dof in pending]

    def _cycle(self) -> None:
        feedback = self._bus.exchange(self._controlwords, self._targets)
        if "6041.13" in self._config.waive:
            feedback = [
                replace(one, statusword=one.statusword & ~cia402.FOLLOWING_ERROR_BIT)
                for one in feedback
            ]
        self._feedback, self._is_moving = feedback, True

    def _follows(self, feedback: Feedback) -> bool:
        """Whether bit 12 is set or waived."""
        is_waived = "6041.12" in self._config.waive
        return is_waived or bool(feedback.statusword & cia402.FOLLOWS_COMMAND)

    def _paced_cycle(self) -> None:
        began = time.monotonic()
        self._cycle()
        time.sleep(max(0.0, self._config.cycle - (time.monotonic() - began)))

    def _run_transition(self, step: Callable[[Motor, State | None, Feedback], bool]) -> None:
        """Cycle until `step` is true for every drive; each new state has a timeout of its own."""
        seen: list[set[State | None]] = [set() for _ in self._targets]
        since = [time.monotonic()] * len(self._targets)
        timeout = self._config.state_timeout
        while True:
            self._paced_cycle()
            all_done = True
            for dof in self._config.all_motors:
                feedback = self._feedback[dof]
                has_answered = not feedback.age or bool(feedback.statusword)
                state = cia402.state_of(feedback.statusword)
                is_done = has_answered and step(dof, state, feedback)
                all_done = all_done and is_done
                if is_done or state not in seen[dof]:
                    seen[dof].add(state)
                    since[dof] = time.monotonic()
                elif time.monotonic() - since[dof] > timeout:
                    raise transition_error(self.names[dof], feedback, self._modes[dof], timeout)
            if all_done:
                return

    def _reset_fault(self, dof: Motor, state: State | None, feedback: Feedback) -> bool:
        if state in (State.FAULT, State.FAULT_REACTION):
            # Fault reset is the rising edge of bit 7.
            self._controlwords[dof] ^= cia402.FAULT_RESET
            return False
        self._controlwords[dof] = cia402.DISABLE_VOLTAGE
        return True

    def _enable(self, dof: Motor, state: State | None, feedback: Feedback) -> bool:
        if state is State.FAULT:
            raise state_error(self.names[dof], feedback)
        word = cia402.next_controlword(state)
        if word is not None:
            self._controlwords[dof] = word
        if state is not State.OPERATION_ENABLED:
            self._targets[dof] = feedback.position  # no step when it becomes enabled
        return state is State.OPERATION_ENABLED

    def _start_following(self, dof: Motor, state: State | None, feedback: Feedback) -> bool:
        if state is not State.OPERATION_ENABLED:
            raise state_error(self.names[dof], feedback)
        if self._modes[dof] is Mode.INTERPOLATED_POSITION:
            self._controlwords[dof] = cia402.ENABLE_INTERPOLATION
        is_entered = "6061" not in self._config.waive or feedback.mode == self._modes[dof]
        return is_entered and self._follows(feedback)

    def _check_state(self, dof: Motor, feedback: Feedback) -> None:
        name, mode = self.names[dof], self._modes[dof]
        if cia402.state_of(feedback.statusword) is not State.OPERATION_ENABLED:
            raise state_error(self.names[dof], feedback)
        if feedback.mode != mode:
            raise StateError(
                name,
                f"it changed from mode {mode.value} to {feedback.mode}",
                "End every other program that commands it",
            )
        if not self._follows(feedback):
            raise ignores_setpoints(name, feedback)
