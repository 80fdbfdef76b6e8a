"""Three drives cycle by cycle: from state to state until they follow, and to quick stop."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping

from tautscope.config import DrivesConfig
from tautscope.dof import Dof
from tautscope.errors import DriveError
from tautscope.hardware import cia402
from tautscope.hardware import object_dictionary as objects
from tautscope.hardware.cia402 import Mode, State
from tautscope.hardware.link import Feedback, Link
from tautscope.hardware.watch import Watch

CONFIRMATIONS = 2
"""Answers in a row that show a motor at rest; one may have been under way before the stop."""


class Cycles:
    """What three drives are told in every cycle, and what they say.

    Args:
        config: Times.
        link: The bus they are on.
        modes: The modes they took.
        watch: Judges what they say.

    Every method raises what `Link.cycle` raises.
    """

    def __init__(
        self, config: DrivesConfig, link: Link, modes: Mapping[Dof, Mode], watch: Watch
    ) -> None:
        self._config = config
        self._link = link
        self._modes = modes
        self._watch = watch
        self._words = [cia402.DISABLE_VOLTAGE] * 3
        self._targets = [0, 0, 0]
        self._feedback: list[Feedback] = []
        self._last_cycle = time.monotonic()
        self._is_operational = False

    def send(self, targets: list[int]) -> list[Feedback]:
        """One cycle with new targets [counts]."""
        self._targets = targets
        self._cycle()
        return self._feedback

    def enable(self, *, reset_faults: bool) -> list[Feedback]:
        """Enable the motors where they are, and cycle until they follow.

        Args:
            reset_faults: Acknowledge faults first.

        Raises:
            FollowingError: A motor is outside its travel.
            StateError: A drive holds a fault, or did not reach a state in `state_timeout`.
            SilentDriveError: A drive did not answer for as long.
        """
        self._targets = [self._link.read(dof, objects.POSITION) for dof in Dof]
        self._watch.check_start(self._targets)
        self._link.operational()
        self._is_operational = True
        if reset_faults:
            self._walk(self._reset)
        self._words = [cia402.DISABLE_VOLTAGE] * 3
        self._walk(self._enable)
        if Mode.INTERPOLATED_POSITION in self._modes.values():
            for _ in range(self._config.lead_points):
                self._paced_cycle()
        self._walk(self._follow)
        return self._feedback

    def quick_stop(self) -> list[str]:
        """Quick-stop all drives; the names of those that do not confirm it in `state_timeout`.

        Does nothing where they rest: never cycled, or stopped before.
        """
        if not self._feedback:
            return []
        self._feedback = []
        return self._until(cia402.QUICK_STOP, cia402.AT_REST)

    def disable(self) -> list[str]:
        """`quick_stop`, then take the power from the motors; the names of those not confirmed.

        From operation enabled, disable voltage alone would let a moving motor coast. Does nothing
        where they never cycled.
        """
        if not self._is_operational:
            return []
        return self.quick_stop() or self._until(cia402.DISABLE_VOLTAGE, cia402.UNPOWERED)

    def _until(self, controlword: int, states: frozenset[State]) -> list[str]:
        """Tell all drives, until each confirms one of these states; names of those that do not."""
        confirmed = [0, 0, 0]
        deadline = time.monotonic() + self._config.state_timeout
        while min(confirmed) < CONFIRMATIONS and time.monotonic() < deadline:
            try:
                said = self._link.halt(controlword, self._targets)
            except DriveError:
                break  # the bus itself is gone
            for dof, one in enumerate(said):
                there = not one.age and cia402.state_of(one.statusword) in states
                confirmed[dof] = confirmed[dof] + 1 if there else 0
            if not all(confirmed):
                time.sleep(self._config.cycle / 4)
        pending = [dof for dof in Dof if confirmed[dof] < CONFIRMATIONS]
        if pending:
            self._link.abandon(pending)
        return [self._link.name(dof) for dof in pending]

    def _cycle(self) -> None:
        now, traffic = time.monotonic(), self._watch.traffic
        if traffic.cycles:
            traffic.longest_pause = max(traffic.longest_pause, now - self._last_cycle)
        self._last_cycle = now
        traffic.cycles += 1
        self._feedback = self._link.cycle(self._words, self._targets)

    def _paced_cycle(self) -> None:
        began = time.monotonic()
        self._cycle()
        time.sleep(max(0.0, self._config.cycle - (time.monotonic() - began)))

    def _walk(self, step: Callable[[Dof, State | None, Feedback], bool]) -> None:
        """Cycle until `step` is content with every drive; each state has its own time."""
        seen: list[int | None] = [None] * 3
        since = [time.monotonic()] * 3
        while True:
            self._paced_cycle()
            done = True
            for dof in Dof:
                said = self._feedback[dof]
                if said.age and not said.statusword:
                    content = False  # it has not spoken yet
                else:
                    content = step(dof, cia402.state_of(said.statusword), said)
                done = done and content
                if content or said.statusword != seen[dof]:
                    seen[dof], since[dof] = said.statusword, time.monotonic()
                elif time.monotonic() - since[dof] > self._config.state_timeout:
                    raise self._watch.stuck(dof, said)
            if done:
                return

    def _reset(self, dof: Dof, state: State | None, said: Feedback) -> bool:
        if state in (State.FAULT, State.FAULT_REACTION):
            # Only the change of bit 7 from 0 to 1 counts.
            self._words[dof] ^= cia402.FAULT_RESET
            return False
        self._words[dof] = cia402.DISABLE_VOLTAGE
        return True

    def _enable(self, dof: Dof, state: State | None, said: Feedback) -> bool:
        if state is State.FAULT:
            raise self._watch.wrong_state(dof, said)
        word = cia402.towards_enabled(state)
        if word is not None:
            self._words[dof] = word
        if state is not State.OPERATION_ENABLED:
            self._targets[dof] = said.position  # what it stands at is what it shall hold
        return state is State.OPERATION_ENABLED

    def _follow(self, dof: Dof, state: State | None, said: Feedback) -> bool:
        if state is not State.OPERATION_ENABLED:
            raise self._watch.wrong_state(dof, said)
        if self._modes[dof] is Mode.INTERPOLATED_POSITION:
            self._words[dof] = cia402.INTERPOLATE
        return bool(said.statusword & cia402.FOLLOWS)
