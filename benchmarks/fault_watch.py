"""What surrounds the loop in a run with a fault: the drives' own protection, and a witness."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from doc_pages import ROOT
from hysteresis_runs import FeatureCamera
from numpy.typing import ArrayLike, NDArray
from tautscope.config import Config, load_config
from tautscope.hardware.following_error import FollowingErrorMonitor
from tautscope.hardware.rig import require_drives
from tautscope.loop.reduction import HysteresisReduction, Report
from tautscope.loop.rig import Frame, Sample
from tautscope.loop.safety import Reaction, Supervision
from tautscope.twin import Twin
from tautscope.twin.faults import FaultyRig, FeatureFrame

Floats = NDArray[np.float64]

STILL = 1.0
"""How long a motion that was stopped is watched [s]."""
DRIVES = require_drives(load_config(ROOT / "configs" / "bench.toml"))
"""How they are watched: the bench's."""
RANKS = {reaction: reaction.rank for reaction in Reaction}
HOLD_ESTIMATE = RANKS[Reaction.HOLD_ESTIMATE]
HOLD_MOTION = RANKS[Reaction.HOLD_MOTION]
QUICK_STOP = RANKS[Reaction.QUICK_STOP]


class FeatureTwin(Twin):
    """A twin without pictures: true features with noise on top are what a detector would say.

    Attributes:
        truth: True state after each tick (3,) [m, rad, rad].
        commands: What the motors were told in each.
    """

    def __init__(self, config: Config) -> None:
        super().__init__(config, images=False)
        self._eye = FeatureCamera(config)
        self.truth: list[Floats] = []
        self.commands: list[Floats] = []

    def reset(self) -> Sample:
        """As `Twin.reset`."""
        return self._looked(super().reset())

    def step(self, command: ArrayLike) -> Sample:
        """As `Twin.step`."""
        sample = self._looked(super().step(command))
        if sample.true_state is not None:
            self.truth.append(sample.true_state)
        self.commands.append(np.array(command, dtype=np.float64))
        return sample

    def _looked(self, sample: Sample) -> Sample:
        frame = self._eye.look(sample)
        return sample if frame is None else replace(sample, frame=frame)


def look(loop: HysteresisReduction, frame: Frame) -> Report:
    """What the loop does with what a detector says: bands, or none."""
    assert isinstance(frame, FeatureFrame)
    lost = np.isnan(frame.features).all()
    return loop.on_features(None if lost else frame.features, frame.captured_at)


@dataclass
class Watch:
    """Sees what the loop says of itself, tick by tick; a `tautscope.runs.experiment.Log`.

    Attributes:
        clock: The twin's own [s].
        since: When the fault begins [s].
        period: Of the tick [s].
        flags: From when to when each was raised [s]; infinite while it is.
        reaction: The highest since then, of rank 0 to 7.
        stop: When the motion was stopped since then [s].
        width: Largest insertion slack the loop believed in since then [m].
        step: Largest change of the insertion command in a tick since then [m].
        holds: How often learning was held or more, from the first tick on.
        stops: How often motion was held or more, likewise.
    """

    clock: Callable[[], float]
    since: float
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
    _last: Floats | None = None
    _raised: tuple[str, ...] = ()
    _reaction: Reaction = Reaction.NONE

    def look(self, loop: HysteresisReduction, frame: Frame) -> Report:
        """An image update."""
        self.loop = loop
        report = look(loop, frame)
        if self.clock() >= self.since:
            self.width = max(self.width, float(report.delta_plus[0] - report.delta_minus[0]))
        return report

    def tick(
        self, sample: Sample, reference: Floats, command: Floats, made_at: float | None = None
    ) -> None:
        """A control tick."""
        now = self.clock()
        if now >= self.since and self._last is not None:
            self.step = max(self.step, abs(float(command[0] - self._last[0])))
        self._last = command
        if self.loop is not None:
            self.read(now, self.loop.supervision)

    def frame(self, now: float, frame: Frame, report: Report) -> None:
        """Nothing: `look` has seen it."""

    def event(self, now: float, what: str) -> None:
        """Nothing: the drives were told."""

    def read(self, now: float, supervision: Supervision) -> None:
        """What the supervisor says."""
        if supervision.flags != self._raised:
            for name in self._raised:
                if name not in supervision.flags:
                    self.flags[name][-1][1] = now
            self._raised = supervision.flags
            for name in self._raised:
                self.raised(name, now)
        reaction = supervision.reaction
        if reaction is not self._reaction:
            before, rank = RANKS[self._reaction], RANKS[reaction]
            self.holds += before < HOLD_ESTIMATE <= rank
            self.stops += before < HOLD_MOTION <= rank
            self._reaction = reaction
        if now >= self.since:
            self.note(now, reaction)

    def raised(self, name: str, now: float) -> None:
        """A flag, from now on."""
        times = self.flags.setdefault(name, [])
        if not times or math.isfinite(times[-1][1]):
            times.append([now, math.inf])

    def note(self, now: float, reaction: Reaction) -> None:
        """A reaction in force."""
        rank = RANKS[reaction]
        if rank > self.rank:
            self.reaction, self.rank = str(reaction), rank
        if rank >= HOLD_MOTION:
            self.stop = min(self.stop, now)

    def said(self) -> dict[str, Any]:
        """What of it is kept, times from `since` [s]; the stop in ticks."""
        stopped = math.isfinite(self.stop)
        return {
            "reaction": self.reaction,
            "flags": {
                name: [(begin - self.since, end - self.since) for begin, end in times]
                for name, times in self.flags.items()
            },
            "stopped": stopped,
            "step": self.step,
            "width": self.width,
            "holds": self.holds,
            "stops": self.stops,
            "stop_tick": round((self.stop - self.since) / self.period) if stopped else None,
        }


class Driven:
    """The rig with what drives do of themselves: they watch their error, and can be stopped.

    Args:
        rig: What they move; may be exchanged during a run.
        watch: Told what the drives do; says when the loop wants them stopped.
        watching: What they look at, of `following_error` and `drive_fault`.
        at: When `then` is called [s].
        then: Before the first tick at that time.
    """

    def __init__(
        self,
        rig: FaultyRig,
        watch: Watch,
        watching: Collection[str] = ("following_error", "drive_fault"),
        at: float = math.inf,
        then: Callable[[], None] | None = None,
    ) -> None:
        self.rig, self._watch, self._watching = rig, watch, watching
        self._at, self._then = at, then
        self._following = FollowingErrorMonitor(DRIVES, rig.control_period)
        self._stopped = False

    @property
    def control_period(self) -> float:
        """[s]."""
        return self.rig.control_period

    def reset(self) -> Sample:
        """As the rig."""
        sample = self.rig.reset()
        self._following.reset(sample.applied)
        return sample

    def step(self, command: ArrayLike) -> Sample:
        """As the rig, unless the drives were stopped."""
        if self._then is not None and self.rig.true_time >= self._at - 1e-9:
            then, self._then = self._then, None
            then()
        if self._watch.rank >= QUICK_STOP and not self._stopped:
            self.stop()
        said = np.asarray(command, dtype=np.float64)
        sample = self.rig.step(said)
        if self._watching and not self._stopped:
            self._check(said, sample.applied)
        return sample

    def close(self) -> None:
        """As the rig."""
        self.rig.close()

    def stop(self) -> None:
        """Quick stop, and the brakes close."""
        self._stopped = True
        self.rig.brake()

    def _check(self, said: Floats, applied: Floats) -> None:
        strays = self._following.update(said, applied).any()
        if "drive_fault" in self._watching and self.rig.drive_fault:
            self._give_up("drive_fault")
        elif "following_error" in self._watching and strays:
            self._give_up("following_error")

    def _give_up(self, flag: str) -> None:
        now = self.rig.true_time
        self.stop()
        if self._watch.loop is not None:
            self._watch.loop.raise_flag(flag)
        self._watch.raised(flag, now)
        self._watch.note(now, Reaction.QUICK_STOP)
