"""The loop with operating states and detection in the background, without ROS."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray
from tautscope import Config, Frame, HysteresisReduction
from tautscope.loop.measurement import Measurement
from tautscope.loop.reduction import Report
from tautscope.loop.safety import Reaction, Supervision
from tautscope.runs.control_loop import BackgroundUpdater

Floats = NDArray[np.float64]
START_TOLERANCE = {"mm": 1e-3, "rad": 0.05}
"""Largest distance of the drives from the last command when enabled again [m or rad]."""


class OperatingState(StrEnum):
    """Operating states of the collaborative robotics toolkit (CRTK)."""

    DISABLED = "DISABLED"
    """The loop does not run, and no command is to be sent."""
    ENABLED = "ENABLED"
    """The reference is followed."""
    PAUSED = "PAUSED"
    """The command is held; `resume` continues where the reference then is."""
    FAULT = "FAULT"
    """The drives are to be stopped; `enable` clears it, unless the loop has to be created anew."""


@dataclass(frozen=True, slots=True)
class Tick:
    """Result of a control tick.

    Attributes:
        command: (n,) [m or rad]; NaN before the first reference.
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
        reference: The newest reference that went into the loop (n,) [m or rad]; NaN before.
        state: The operating state.
        is_misplaced: Whether enabling was refused: the drives were not where the last command was.
    """

    def __init__(self, config: Config, executor: Executor) -> None:
        self.loop = HysteresisReduction(config)
        if not config.dof:
            # It creates the detector, which takes 0.1 s, now and not in a tick.
            self.loop.prepare_detection(Frame(np.empty(0, np.uint8), 0.0, 0))
        self.period = config.control.period
        self._start_tolerance = [START_TOLERANCE[dof.display_unit] for dof in config.dofs]
        self.reference = np.full(len(config.dofs), np.nan)
        self.state = OperatingState.DISABLED
        self.is_misplaced = False
        self._updater = BackgroundUpdater(executor)
        self._command = self.reference.copy()
        self._measured: Floats | None = None
        self._next: tuple[Floats, float | None] | None = None
        self._made_at: float | None = None
        self._is_clutching = False
        self._is_paused = False
        self._is_engaging = False
        self._engaged_at = -math.inf

    def set_measured(self, position: Sequence[float] | Floats) -> None:
        """Position of the drives (n,) [m or rad]; values that are not finite are ignored."""
        if np.isfinite(position).all():
            self._measured = np.array(position, np.float64)

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
        if self.state is OperatingState.DISABLED:
            return Tick(self._command, False, self.state)
        if new is not None:
            self._made_at = new[1]
        made_at = self._made_at
        is_resting = self._is_paused or self.is_misplaced
        if self._is_clutching and not is_resting and new is not None:
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
        self._update_state()
        is_sent = self.state is not OperatingState.FAULT and bool(np.isfinite(self._command).all())
        return Tick(self._command, is_sent, self.state)

    def exchange(
        self, frame: Frame | None, measurements: Sequence[Measurement] = ()
    ) -> list[tuple[Frame | Measurement, Report]]:
        """After the command of a tick was sent: the updates, and the next detection.

        Args:
            frame: The newest image, if one arrived since the last tick.
            measurements: What other sensors measured.
        """
        if self.state is OperatingState.DISABLED:
            return []
        reports: list[tuple[Frame | Measurement, Report]] = []
        reports += self._updater.update(self.loop, frame)
        reports += [(each, self.loop.on_sample(each)) for each in measurements]
        if reports:
            self._update_state()
        return reports

    def request(self, command: str) -> bool:
        """Execute a `state_command`; whether there is one of this name."""
        commands: dict[str, Callable[[], None]] = {
            "enable": self.enable,
            "disable": self.disable,
            "pause": self.pause,
            "resume": self.resume,
            "acknowledge": self.loop.acknowledge,
        }
        if command in commands:
            commands[command]()
            self._update_state()
        return command in commands

    def enable(self) -> None:
        """Begin where the drives are; nothing moves before the next reference."""
        if self.state is OperatingState.ENABLED:
            return
        has_command = bool(np.isfinite(self._command).all())
        if has_command and self._measured is not None:
            distance = np.abs(self._measured - self._command)
            self.is_misplaced = bool((distance > self._start_tolerance).any())
            if self.is_misplaced:
                self.state = OperatingState.FAULT
                return
        self.state = OperatingState.ENABLED
        self._is_engaging = True
        if has_command:
            self._engage()
        elif self._measured is not None:
            # The first reference passes: the command begins where the drives are.
            self.reference = self._measured
            self._is_clutching = True

    def disable(self) -> None:
        """End the motion; no command is sent any more."""
        self.state = OperatingState.DISABLED
        self._is_paused = self.is_misplaced = False

    def pause(self) -> None:
        """Hold the command until `resume`."""
        self._is_paused = self._is_paused or self.state is OperatingState.ENABLED

    def resume(self) -> None:
        """Continue held motion at the next reference, wherever it is."""
        if self.state is OperatingState.PAUSED:
            self._engage()

    def raise_drive_fault(self) -> None:
        """Stop: a drive reports a fault."""
        if self.state is not OperatingState.DISABLED:
            self.loop.raise_flag("drive_fault")
            self._update_state()

    @property
    def supervision(self) -> Supervision:
        """Reaction and flags in force."""
        return self.loop.supervision

    def _engage(self) -> None:
        self.loop.engage()
        self._is_engaging = True
        self._is_paused = False
        self._is_clutching = bool(np.isfinite(self._command).all())

    def _update_state(self) -> None:
        if self.state is OperatingState.DISABLED:
            return
        reaction = self.loop.supervision.reaction
        if self.is_misplaced or reaction.rank >= Reaction.QUICK_STOP.rank:
            self.state = OperatingState.FAULT
        elif self._is_paused or reaction is Reaction.HOLD_MOTION:
            self.state = OperatingState.PAUSED
        else:
            self.state = OperatingState.ENABLED
