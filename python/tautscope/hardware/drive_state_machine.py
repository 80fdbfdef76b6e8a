"""State transitions of three drives (CiA 402): enabling, following set-points, quick stop."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping

from tautscope.config import DrivesConfig
from tautscope.dof import Dof
from tautscope.errors import DriveError
from tautscope.hardware import cia402
from tautscope.hardware import object_dictionary as objects
from tautscope.hardware.cia402 import Mode, State
from tautscope.hardware.drive_monitor import DriveMonitor
from tautscope.hardware.fieldbus import Feedback, Fieldbus

CONFIRMATIONS = 2
"""Consecutive answers that confirm a state; the first may predate the command."""


class DriveStateMachine:
    """Steps three drives through the CiA 402 state machine, one bus cycle after the other.

    Args:
        config: Cycle and timeouts.
        bus: The drives.
        modes: Mode of operation of each drive.
        monitor: Checks the start positions, counts cycles, and makes the errors.

    Every method raises what `Fieldbus.exchange` raises.
    """

    def __init__(
        self, config: DrivesConfig, bus: Fieldbus, modes: Mapping[Dof, Mode], monitor: DriveMonitor
    ) -> None:
        self._config = config
        self._bus = bus
        self._modes = modes
        self._monitor = monitor
        self._controlwords = [cia402.DISABLE_VOLTAGE] * 3
        self._targets = [0, 0, 0]
        self._feedback: list[Feedback] = []
        self._last_cycle = time.monotonic()
        self._is_operational = False

    def exchange(self, targets: list[int]) -> list[Feedback]:
        """Run one cycle with new target positions [counts]."""
        self._targets = targets
        self._cycle()
        return self._feedback

    def enable(self, *, reset_faults: bool) -> list[Feedback]:
        """Enable the motors at their present positions, and cycle until they follow set-points.

        Args:
            reset_faults: Reset faults first.

        Raises:
            FollowingError: A motor is outside its travel.
            StateError: A drive is in fault, or did not reach a state within `state_timeout`.
            SilentDriveError: A drive did not answer within `state_timeout`.
        """
        self._targets = [self._bus.read(dof, objects.POSITION_ACTUAL) for dof in Dof]
        self._monitor.check_start_positions(self._targets)
        self._bus.start()
        self._is_operational = True
        if reset_faults:
            self._run_transition(self._reset_fault)
        self._controlwords = [cia402.DISABLE_VOLTAGE] * 3
        self._run_transition(self._enable)
        if Mode.INTERPOLATED_POSITION in self._modes.values():
            for _ in range(self._config.lead_points):
                self._paced_cycle()
        self._run_transition(self._start_following)
        return self._feedback

    def quick_stop(self) -> list[str]:
        """Quick-stop all drives; names of those that do not confirm it within `state_timeout`.

        Does nothing if the drives never ran, or are stopped already.
        """
        if not self._feedback:
            return []
        self._feedback = []
        return self._command_until(cia402.QUICK_STOP, cia402.STOPPED_STATES)

    def disable(self) -> list[str]:
        """Quick-stop, then disable voltage; names of the drives that do not confirm it.

        Disable voltage alone would let a moving motor coast. Does nothing if the drives never ran.
        """
        if not self._is_operational:
            return []
        return self.quick_stop() or self._command_until(
            cia402.DISABLE_VOLTAGE, cia402.POWER_OFF_STATES
        )

    def _command_until(self, controlword: int, states: frozenset[State]) -> list[str]:
        """Repeat a controlword until all drives confirm a state; names of those that do not."""
        confirmed = [0, 0, 0]
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
        pending = [dof for dof in Dof if confirmed[dof] < CONFIRMATIONS]
        if pending:
            self._bus.stop_communication(pending)
        return [self._bus.name(dof) for dof in pending]

    def _cycle(self) -> None:
        now, statistics = time.monotonic(), self._monitor.statistics
        if statistics.cycles:
            statistics.longest_pause = max(statistics.longest_pause, now - self._last_cycle)
        self._last_cycle = now
        statistics.cycles += 1
        self._feedback = self._bus.exchange(self._controlwords, self._targets)

    def _paced_cycle(self) -> None:
        began = time.monotonic()
        self._cycle()
        time.sleep(max(0.0, self._config.cycle - (time.monotonic() - began)))

    def _run_transition(self, step: Callable[[Dof, State | None, Feedback], bool]) -> None:
        """Cycle until `step` is true for every drive; each state has its own timeout."""
        seen: list[int | None] = [None] * 3
        since = [time.monotonic()] * 3
        while True:
            self._paced_cycle()
            all_done = True
            for dof in Dof:
                feedback = self._feedback[dof]
                has_answered = not feedback.age or bool(feedback.statusword)
                is_done = has_answered and step(dof, cia402.state_of(feedback.statusword), feedback)
                all_done = all_done and is_done
                if is_done or feedback.statusword != seen[dof]:
                    seen[dof], since[dof] = feedback.statusword, time.monotonic()
                elif time.monotonic() - since[dof] > self._config.state_timeout:
                    raise self._monitor.transition_error(dof, feedback)
            if all_done:
                return

    def _reset_fault(self, dof: Dof, state: State | None, feedback: Feedback) -> bool:
        if state in (State.FAULT, State.FAULT_REACTION):
            # Fault reset is the rising edge of bit 7.
            self._controlwords[dof] ^= cia402.FAULT_RESET
            return False
        self._controlwords[dof] = cia402.DISABLE_VOLTAGE
        return True

    def _enable(self, dof: Dof, state: State | None, feedback: Feedback) -> bool:
        if state is State.FAULT:
            raise self._monitor.state_error(dof, feedback)
        word = cia402.next_controlword(state)
        if word is not None:
            self._controlwords[dof] = word
        if state is not State.OPERATION_ENABLED:
            self._targets[dof] = feedback.position  # no step when it becomes enabled
        return state is State.OPERATION_ENABLED

    def _start_following(self, dof: Dof, state: State | None, feedback: Feedback) -> bool:
        if state is not State.OPERATION_ENABLED:
            raise self._monitor.state_error(dof, feedback)
        if self._modes[dof] is Mode.INTERPOLATED_POSITION:
            self._controlwords[dof] = cia402.ENABLE_INTERPOLATION
        return bool(feedback.statusword & cia402.FOLLOWS_COMMAND)
