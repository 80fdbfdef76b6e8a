"""Recorder of what the loop reports during a run with a fault."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from common.features import update_from_features
from numpy.typing import NDArray
from tautscope.loop.reduction import HysteresisReduction, Report
from tautscope.loop.rig import Frame, Sample
from tautscope.loop.safety import Reaction, Supervision

Floats = NDArray[np.float64]

RANKS = {reaction: reaction.rank for reaction in Reaction}
HOLD_ESTIMATE = RANKS[Reaction.HOLD_ESTIMATE]
HOLD_MOTION = RANKS[Reaction.HOLD_MOTION]
QUICK_STOP = RANKS[Reaction.QUICK_STOP]


@dataclass
class RunRecorder:
    """Records flags and reactions, tick by tick; implements `tautscope.runs.experiment.Log`.

    Attributes:
        clock: The twin's own clock [s].
        fault_start: Start of the fault [s].
        period: Control period [s].
        flags: [start, end] of each interval in which a flag was raised [s]; end is infinite while
            it is raised.
        reaction: Highest reaction since the start of the fault.
        rank: Its rank, 0 to 7.
        stop: When the motion was stopped since the start of the fault [s].
        width: Largest estimated slack of insertion since then [m].
        step: Largest change of the insertion command in one tick since then [m].
        holds: How often estimation or more was held, from the first tick on.
        stops: How often motion or more was held, from the first tick on.
    """

    clock: Callable[[], float]
    fault_start: float
    period: float
    flags: dict[str, list[list[float]]] = field(default_factory=dict)
    reaction: str = "none"
    rank: int = 0
    stop: float = math.inf
    width: float = 0.0
    step: float = 0.0
    holds: int = 0
    stops: int = 0
    loop: HysteresisReduction | None = None
    _command: Floats | None = None
    _raised: tuple[str, ...] = ()
    _reaction: Reaction = Reaction.NONE

    def update(self, loop: HysteresisReduction, frame: Frame) -> Report:
        """Pass a frame to the loop and record the estimated slack."""
        self.loop = loop
        report = update_from_features(loop, frame)
        if self.clock() >= self.fault_start:
            self.width = max(self.width, float(report.delta_plus[0] - report.delta_minus[0]))
        return report

    def tick(
        self, sample: Sample, reference: Floats, command: Floats, made_at: float | None = None
    ) -> None:
        """Record a control tick."""
        now = self.clock()
        if now >= self.fault_start and self._command is not None:
            self.step = max(self.step, abs(float(command[0] - self._command[0])))
        self._command = command
        if self.loop is not None:
            self.record(now, self.loop.supervision)

    def frame(self, now: float, frame: Frame, report: Report) -> None:
        """Do nothing: `update` has recorded the frame."""

    def event(self, now: float, what: str) -> None:
        """Do nothing: the drives record their own events."""

    def record(self, now: float, supervision: Supervision) -> None:
        """Record flags and reaction of the supervisor."""
        if supervision.flags != self._raised:
            for name in self._raised:
                if name not in supervision.flags:
                    self.flags[name][-1][1] = now
            self._raised = supervision.flags
            for name in self._raised:
                self.record_flag(name, now)
        reaction = supervision.reaction
        if reaction is not self._reaction:
            before, rank = RANKS[self._reaction], RANKS[reaction]
            self.holds += before < HOLD_ESTIMATE <= rank
            self.stops += before < HOLD_MOTION <= rank
            self._reaction = reaction
        if now >= self.fault_start:
            self.record_reaction(now, reaction)

    def record_flag(self, name: str, now: float) -> None:
        """Record that a flag is raised from now on."""
        intervals = self.flags.setdefault(name, [])
        if not intervals or math.isfinite(intervals[-1][1]):
            intervals.append([now, math.inf])

    def record_reaction(self, now: float, reaction: Reaction) -> None:
        """Record that a reaction is in force."""
        rank = RANKS[reaction]
        if rank > self.rank:
            self.reaction, self.rank = str(reaction), rank
        if rank >= HOLD_MOTION:
            self.stop = min(self.stop, now)

    def summary(self) -> dict[str, Any]:
        """Return the record with times from the start of the fault [s]; the stop as a tick."""
        is_stopped = math.isfinite(self.stop)
        return {
            "reaction": self.reaction,
            "flags": {
                name: [(start - self.fault_start, end - self.fault_start) for start, end in each]
                for name, each in self.flags.items()
            },
            "stopped": is_stopped,
            "step": self.step,
            "width": self.width,
            "holds": self.holds,
            "stops": self.stops,
            "stop_tick": round((self.stop - self.fault_start) / self.period)
            if is_stopped
            else None,
        }
