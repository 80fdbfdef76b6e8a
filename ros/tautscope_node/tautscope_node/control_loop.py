"""The loop with operating states and detection in the background, without ROS."""

from __future__ import annotations

import math
from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from tautscope import Config, Frame, HysteresisReduction
from tautscope.loop.measurement import Measurement
from tautscope.loop.operating_state import STATE_COMMANDS, OperatingState, StateMachine
from tautscope.loop.reduction import Report
from tautscope.loop.safety import Supervision
from tautscope.runs.control_loop import BackgroundUpdater

Floats = NDArray[np.float64]
DRIVER_TIMEOUT = 0.1
"""Longest time without positions from the drives, as in tautscope.ros2.driver [s]."""
START_TOLERANCE = {"mm": 1e-3, "rad": 0.05}
"""Largest distance of the drives from the last command when enabled again [m or rad]."""


@dataclass(frozen=True, slots=True)
class Tick:
    """Result of a control tick.

    Attributes:
        command: (n,) [m or rad]; NaN before it was enabled.
        is_sent: Whether the command is to be sent to the drives.
        state: The operating state.
    """

    command: Floats
    is_sent: bool
    state: OperatingState


class ControlLoop:
    """Control loop: reference in, command out, in operating states.

    The same states, requests and order as `ControlLoop` of the package tautscope_control. Times are
    seconds on one clock, the same for references, ticks and images. All methods are for one thread.

    Args:
        config: The configuration.
        executor: Detects the bands, in a thread of its own.

    Attributes:
        loop: The loop itself.
        is_unmeasured: Whether enabling was refused: it is not known where the drives are.
        reference: The newest reference that went into the loop (n,) [m or rad]; NaN before.
    """

    def __init__(self, config: Config, executor: Executor) -> None:
        self.loop = HysteresisReduction(config)
        if not config.dof:
            # It creates the detector, which takes 0.1 s, now and not in a tick.
            self.loop.prepare_detection(Frame(np.empty(0, np.uint8), 0.0, 0))
        self.period = config.control.period
        self._start_tolerance = [START_TOLERANCE[dof.display_unit] for dof in config.dofs]
        self.reference = np.full(len(config.dofs), np.nan)
        self._states = StateMachine()
        self._executor = executor
        self._updater = BackgroundUpdater(executor)
        self._command = self.reference.copy()
        self._measured = self.reference.copy()
        self._measured_at = -math.inf
        self._next: tuple[Floats, float | None] | None = None
        self._made_at: float | None = None
        self.is_unmeasured = False
        self._is_clutching = False
        self._is_engaging = False
        self._engaged_at = -math.inf

    def set_measured(self, position: Sequence[float] | Floats, time: float) -> None:
        """Position of the drives (n,) [m or rad] at a time [s].

        Without one of the last `DRIVER_TIMEOUT` `enable` is refused, and later it is a drive fault.
        Values that are not finite are ignored.
        """
        if np.isfinite(position).all():
            self._measured, self._measured_at = np.array(position, np.float64), time

    def set_reference(
        self, position: Sequence[float] | Floats, made_at: float | None = None
    ) -> None:
        """The newest reference (n,) [m or rad], made at a time [s]; none if it is not finite."""
        if np.isfinite(position).all():
            self._next = np.array(position, np.float64), made_at

    def step(self, time: float) -> Tick:
        """One control tick at a time [s]."""
        new, self._next = self._next, None
        if self._is_engaging:
            self._engaged_at, self._is_engaging = time, False
        if new is not None and new[1] is not None and new[1] < self._engaged_at:
            # An old reference must not begin a motion, nor stop one that has not begun.
            new = None
        if not self._is_measured(time):
            self.raise_drive_fault()
        if self.state is OperatingState.DISABLED:
            return Tick(self._command, False, self.state)
        if new is not None:
            self._made_at = new[1]
        made_at = self._made_at
        is_resting = self._states.goal in (OperatingState.PAUSED, OperatingState.FAULT)
        has_command = bool(np.isfinite(self._command).all())
        if self._is_clutching and not is_resting and new is not None and has_command:
            # Where the operator is now is where the motion continues.
            self.loop.engage()
            self._is_clutching = False
            self.reference = new[0]
        elif is_resting or self._is_clutching:
            made_at = None
        elif new is not None:
            self.reference = new[0]
        if np.isfinite(self.reference).all():
            self._command = self.loop.step(self.reference, time, made_at)
        state = self.state
        is_sent = state is not OperatingState.FAULT and bool(np.isfinite(self._command).all())
        return Tick(self._command, is_sent, state)

    def exchange(
        self, frame: Frame | None, measurements: Sequence[Measurement] = ()
    ) -> list[tuple[Frame | Measurement, Report]]:
        """After the command of a tick was sent: the updates, and the next detection.

        Args:
            frame: The newest image, if one arrived since the last tick.
            measurements: What other sensors measured.
        """
        if self.state is OperatingState.DISABLED:
            # An image whose detection still runs is not used when it is enabled again.
            self._updater = BackgroundUpdater(self._executor)
            return []
        reports: list[tuple[Frame | Measurement, Report]] = []
        reports += self._updater.update(self.loop, frame)
        reports += [(each, self.loop.on_sample(each)) for each in measurements]
        return reports

    def request(self, command: str, time: float) -> bool:
        """Execute a `state_command` at a time [s]; whether there is one of this name."""
        if command == "acknowledge":
            self.loop.acknowledge()
        elif command in STATE_COMMANDS:
            is_accepted = self._states.accept(command, self.supervision.reaction)
            self.is_unmeasured &= not is_accepted
            if is_accepted and command == "enable":
                self._enable(time)
            elif is_accepted and command == "resume":
                self._engage()
        else:
            return False
        return True

    def _is_measured(self, time: float) -> bool:
        return abs(time - self._measured_at) <= DRIVER_TIMEOUT

    def _enable(self, time: float) -> None:
        """Begin where the drives are; nothing moves before the next reference."""
        if not self._is_measured(time):
            self._states.goal, self.is_unmeasured = OperatingState.DISABLED, True
            return
        if not np.isfinite(self._command).all():
            # The loop passes its first reference: the command begins where the drives are.
            self.reference = self._measured
        elif (np.abs(self._measured - self._command) > self._start_tolerance).any():
            self._states.goal = OperatingState.FAULT
            return
        self._engage()

    def raise_drive_fault(self) -> None:
        """Stop: a drive reports a fault."""
        # Drives repeat it; a flag that is raised again after `safety.hold_time` could not be
        # cleared any more.
        is_raised = "drive_fault" in self.supervision.flags
        if self.state is not OperatingState.DISABLED and not is_raised:
            self.loop.raise_flag("drive_fault")

    @property
    def state(self) -> OperatingState:
        """The operating state."""
        return self._states.state(self.supervision.reaction)

    @property
    def is_misplaced(self) -> bool:
        """Whether enabling was refused: the drives were not where the last command was."""
        return self._states.goal is OperatingState.FAULT

    @property
    def supervision(self) -> Supervision:
        """Reaction and flags in force."""
        return self.loop.supervision

    def _engage(self) -> None:
        self.loop.engage()
        self._is_engaging = self._is_clutching = True
