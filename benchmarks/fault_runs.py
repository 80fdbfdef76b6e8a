"""Runs with a fault, all of a seed from one warm instrument.

The loop learns the slack in two strokes; then the process forks, once for every fault, so that each
run goes on from the very same state of loop and physics, whatever that state consists of. A run
alone gives the figures it gives among others.
"""

from __future__ import annotations

import math
import os
import pickle
import traceback
from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from fault_watch import QUICK_STOP, STILL, Device, Driven, FeatureTwin, Floats, Hand, Watch
from tautscope.config import Config, Profile, load_config
from tautscope.dof import Dof
from tautscope.errors import ConfigError, TautscopeError
from tautscope.experiment import run_experiment
from tautscope.reduction import HysteresisReduction
from tautscope.twin.fault_motion import RATE
from tautscope.twin.faults import KINDS, PER_MM, Fault, FaultyHand, FaultyRig, Target

PERIODS = {Dof.INSERTION: 7.5, Dof.ROTATION: 10.0, Dof.BENDING: 10.0}
"""Of the hand's sines [s]; insertion, with 15 mm, reaches 12.6 mm/s."""
LEARNING = 15.0
"""In which the slack is learnt; the fault comes in the stroke forth and back after it [s]."""
WATCHED = 5.0
"""After the end of a fault that passes: a stroke and a third [s]."""
WATCHED_FOR_GOOD = 10.0
"""After the begin of one that stays [s]."""
PASSES = (0.1, 2.0)
"""How long the others take [s]."""
SHARE_PASSING = 0.7
DECADES = 30.0
"""Severities that span more are drawn evenly in their logarithm."""
PLAY = np.array([10e-3, 1.8, 1.1])
"""Slack of the instrument, the article's Table 1 [m, rad, rad]."""
FREE_GAIN = 5.0
PASSING = 0.1 * PLAY
"""Goal for a fault that passes: 1.0 mm, and the like share of the other DOFs' slack."""
GIVEN_BACK = {"paper": 1 - 1 / FREE_GAIN, "best": 1.0}
"""Share of the slack that a profile makes up for, and gives back when it can no longer."""
SPARE = 0.03 * PLAY
"""0.3 mm, and the like."""

HELD = {"hand_nan", "hand_silent", "stall", "stalls"}
"""While these act the hand means no motion; what it does then is not to be made up for."""
PUSHED = {"tissue_pushes", "tissue_jerks", "section_stiff", "section_loose"}
"""These move the tip by themselves: what counts is what the loop adds."""
SHAKEN = {"hand_noisy", "hand_tremor"}
"""What the hand itself does to the tip is taken off."""
STARTS = {name for name, kind in KINDS.items() if kind.target is Target.START}


@dataclass(frozen=True)
class Outcome:
    """What is to be said of a run.

    Attributes:
        kind: Of the fault.
        seed: Of instrument, noise, motion, and when and how much fails.
        fault: What failed.
        excursion: Largest deviation of the tip (3,) [m, rad, rad]; see `excursion`.
        detected: Time from the fault to the first flag or refusal that is its own [s]; NaN if none.
        reaction: The highest.
        flags: All that are its own: raised earlier than without the fault, or only with it.
        stopped: Whether the motion was stopped.
        step: Largest change of the insertion command in a tick after the fault [m].
        width: Largest insertion slack the loop believed in [m].
        spurious: What is raised without the fault.
    """

    kind: str
    seed: int
    fault: Fault
    excursion: tuple[float, float, float]
    detected: float
    reaction: str
    flags: tuple[str, ...]
    stopped: bool
    step: float
    width: float
    spurious: tuple[str, ...]

    @property
    def passing(self) -> bool:
        """Whether the fault passes."""
        return math.isfinite(self.fault.duration)


def lasting(profile: str) -> Floats:
    """Goal for a fault that stays: what is given back when compensation ends, and a little."""
    return np.asarray(GIVEN_BACK[profile] * PLAY + SPARE, dtype=np.float64)


def judged(
    excursion: Sequence[float], goal: Floats, noticed: bool, stopped: bool
) -> dict[str, Any]:
    """Whether the tip went farther than the goal, and how the run ended.

    ``masked``, ``warned``, ``stopped``, or ``SILENT``: unsafe and not noticed.
    """
    far = np.array(excursion)
    unsafe = bool((far > PASSING).any())
    ending = "stopped" if stopped else "warned" if noticed else "SILENT" if unsafe else "masked"
    return {"beyond": bool((far > goal).any()), "ending": ending}


def study(
    seed: int, kinds: Sequence[str], profile: Profile = "best", off: tuple[str, ...] = ()
) -> list[Outcome]:
    """The runs of one seed."""
    config = configured(seed, profile, off)
    begun = [started(config, seed, kind) for kind in kinds if kind in STARTS]
    warm = [kind for kind in kinds if kind not in STARTS]
    return begun + (Instrument(config, seed, off).runs(warm) if warm else [])


Said = dict[str, Any]
"""As `Watch.said`."""


@dataclass(frozen=True)
class Traces:
    """What a run leaves behind: the tip and the commands from the fault on, and what was said."""

    truth: Floats
    commands: Floats
    said: Said


class Instrument:
    """One seed's instrument with its loop, and all that surrounds them.

    Args:
        config: Of both.
        seed: As `Outcome.seed`.
        off: Detectors that are switched off; of them the drives' own watch concerns it.
        cold: Without learning: what counts begins at once.
    """

    def __init__(
        self, config: Config, seed: int, off: tuple[str, ...] = (), cold: bool = False
    ) -> None:
        self._config, self._seed = config, seed
        self._since = 0.0 if cold else began(config, seed)
        self._moving = {dof: PERIODS[dof] for dof in moving(seed)}
        self._twin = FeatureTwin(config)
        self._watch = Watch(self._clock, self._since, config.control.period)
        end = self._since + WATCHED_FOR_GOOD
        self._hand = Hand(config, self._moving, self._clock, end)
        self._device = Device(self._hand, self._watch)
        self._driven = Driven(
            FaultyRig(self._twin, (), seed),
            self._watch,
            hasattr(HysteresisReduction, "supervision") and "following_error" not in off,
            math.inf if cold else self._since,
            self._branch,
        )
        self._plan: Generator[Callable[[], None], Traces, None] | None = None
        self._pipe: int | None = None

    def runs(self, kinds: Sequence[str]) -> list[Outcome]:
        """One run for each kind, all from the state after learning."""
        outcomes: list[Outcome] = []
        self._plan = self._planned(kinds, outcomes)
        try:
            answer = True, self.run()
        except _AllDoneError:
            return outcomes
        except BaseException:
            if self._pipe is None:
                raise
            answer = False, traceback.format_exc()
        with os.fdopen(self._pipe or 0, "wb") as pipe:
            pickle.dump(answer, pipe)
        os._exit(0)

    def run(self) -> Traces:
        """To the end; the drives stop if the loop gives up."""
        watch, driven = self._watch, self._driven
        try:
            run_experiment(driven, self._device, self._config, look=watch.look, log=watch)
        except TautscopeError as error:
            watch.flags.setdefault(getattr(error, "field", type(error).__name__), self._clock())
            watch.note(self._clock(), "quick_stop", QUICK_STOP)
            driven.stop()
            for _ in range(round(STILL / self._config.control.period)):
                driven.step(np.zeros(3))
        return self._traces()

    def _clock(self) -> float:
        return self._twin.time

    def _traces(self) -> Traces:
        first = round(self._since / self._config.control.period)
        truth, commands = self._twin.truth[first:], self._twin.commands[first:]
        return Traces(np.array(truth), np.array(commands), self._watch.said())

    def _planned(
        self, kinds: Sequence[str], outcomes: list[Outcome]
    ) -> Generator[Callable[[], None], Traces, None]:
        """What each fork begins with; it is sent what came of it."""
        nominal = yield lambda: None
        for kind in kinds:
            fault = drawn(kind, self._seed, self._since)
            base = nominal
            if kind in HELD:
                base = yield partial(self._pause, fault)
            elif kind in PUSHED:
                base = yield partial(self._replay, fault, nominal.commands)
            found = yield partial(self._fail, fault)
            outcomes.append(outcome(self._seed, fault, found, base, nominal.said))

    def _branch(self) -> None:
        """Every fork returns from here and goes on; we never do."""
        assert self._plan is not None
        begin = next(self._plan)
        while True:
            found = self._forked(begin)
            if found is None:
                return
            try:
                begin = self._plan.send(found)
            except StopIteration:
                raise _AllDoneError from None

    def _forked(self, begin: Callable[[], None]) -> Traces | None:
        reading, writing = os.pipe()
        child = os.fork()
        if child == 0:
            os.close(reading)
            self._pipe = writing
            begin()
            return None
        os.close(writing)
        with os.fdopen(reading, "rb") as pipe:
            data = pipe.read()
        os.waitpid(child, 0)
        well, answer = pickle.loads(data) if data else (False, "it died")
        if not well:
            raise RuntimeError(answer)
        assert isinstance(answer, Traces)
        return answer

    def _fail(self, fault: Fault) -> None:
        self._driven.rig = FaultyRig(self._twin, (fault,), self._seed)
        self._device.faulty = FaultyHand(self._hand, (fault,), self._seed)
        self._hand.end = self._since + watched(fault)

    def _pause(self, fault: Fault) -> None:
        self._hand.pauses = pauses(fault)
        if fault.row.target is Target.REFERENCE:
            self._hand.paused = [fault.dof]
        self._hand.end = self._since + watched(fault)

    def _replay(self, fault: Fault, commands: Floats) -> None:
        """The same physics, with the commands of the run without a fault."""
        rig = FaultyRig(self._twin, (fault,), self._seed)
        for command in commands[: round(watched(fault) / self._config.control.period)]:
            rig.step(command)
        self._hand.end = 0.0


class _AllDoneError(Exception):
    """Every fork has answered."""


def started(config: Config, seed: int, kind: str) -> Outcome:
    """From the first tick on, against the loop that is told the right slack."""
    fault = drawn(kind, seed, 0.0)
    try:
        wrong = told(config, fault)
    except ConfigError:
        nothing = np.zeros((0, 3))
        said = Watch(lambda: 0.0, 0.0, config.control.period)
        said.flags["ConfigError"] = 0.0
        said.note(0.0, "disable", 7)
        return outcome(seed, fault, Traces(nothing, nothing, said.said()), None, {"flags": {}})
    right = told(config, replace(fault, kind="ok", severity=None))
    found, base = (Instrument(each, seed, cold=True).run() for each in (wrong, right))
    return outcome(seed, fault, found, base, base.said)


def outcome(seed: int, fault: Fault, found: Traces, base: Traces | None, usual: Said) -> Outcome:
    """What a run comes to, against another; what the run without a fault says too is no notice."""
    said, far = dict(found.said), np.zeros(3)
    stop = said.pop("stop_tick")
    if base is not None:
        far = excursion(found.truth, base.truth, stop)
    if fault.kind in SHAKEN:
        far[fault.dof] = max(0.0, far[fault.dof] - fault.size * PER_MM[fault.dof])
    own = {
        name: at
        for name, at in said.pop("flags").items()
        if at < usual["flags"].get(name, math.inf)
    }
    reached = float(far[0]), float(far[1]), float(far[2])
    spurious = tuple(sorted({*said.pop("spurious"), *usual["flags"]}))
    detected = min(own.values(), default=math.nan)
    return Outcome(
        fault.kind, seed, fault, reached, detected, flags=tuple(own), spurious=spurious, **said
    )


def excursion(truth: Floats, base: Floats, stop: int | None) -> Floats:
    """How far the fault took the tip (3,) [m, rad, rad].

    Up to a stop, from where it was in the run without the fault, at the same time; from the stop
    on, from the way it went in that run after that time: a tip that comes to rest there is where it
    was meant to go.
    """
    ticks = min(len(truth), len(base))
    last = ticks if stop is None else min(stop, ticks)
    low, high = base[:ticks].copy(), base[:ticks].copy()
    low[last:] = np.minimum.accumulate(base[last:ticks], axis=0)
    high[last:] = np.maximum.accumulate(base[last:ticks], axis=0)
    far = np.maximum(low - truth[:ticks], truth[:ticks] - high)
    return np.asarray(far.max(axis=0, initial=0.0), dtype=np.float64)


def configured(seed: int, profile: Profile, off: tuple[str, ...]) -> Config:
    """Of loop and twin."""
    changes: dict[str, object] = {"twin.seed": seed}
    if off:
        changes["safety.off"] = off
    return load_config(profile=profile).replace(**changes)


def began(config: Config, seed: int) -> float:
    """When the fault begins: on a tick, anywhere in a stroke forth and back [s]."""
    later = np.random.default_rng([seed, 6]).uniform(0, PERIODS[Dof.INSERTION])
    return round((LEARNING + later) / config.control.period) * config.control.period


def moving(seed: int) -> tuple[Dof, ...]:
    """Insertion alone, or all three DOFs."""
    return tuple(Dof) if seed % 2 else (Dof.INSERTION,)


def drawn(kind: str, seed: int, start: float) -> Fault:
    """The fault of this kind and seed."""
    row = KINDS[kind]
    chance = np.random.default_rng([seed, 7, *kind.encode()])
    passes = row.lasts and chance.uniform() < SHARE_PASSING
    duration = float(chance.uniform(*PASSES)) if passes else math.inf
    dof = Dof(int(chance.choice(moving(seed))))
    low, high = row.severity
    if low > 0 and high / low > DECADES:
        size = float(np.clip(np.exp(chance.uniform(np.log(low), np.log(high))), low, high))
    else:
        size = float(chance.uniform(low, high))
    return Fault(kind, start, duration, size, dof)


def watched(fault: Fault) -> float:
    """How long, from the begin of the fault [s]."""
    passes = math.isfinite(fault.duration)
    return fault.duration + WATCHED if passes else WATCHED_FOR_GOOD


def pauses(fault: Fault) -> list[tuple[float, float]]:
    """When the hand means no motion because of a fault [s]."""
    if fault.kind == "stall":
        return [(fault.start, fault.start + fault.size)]
    end = fault.start + min(fault.duration, WATCHED_FOR_GOOD)
    if fault.kind == "stalls":
        begins = np.arange(fault.start, end, 1 / RATE)
        return [(float(begin), float(begin) + fault.size) for begin in begins]
    return [(fault.start, end)]


def told(config: Config, fault: Fault) -> Config:
    """The configuration that says a wrong slack.

    Raises:
        ConfigError: Of a slack that cannot be.
    """
    width, shift = 1.0, 0.0
    if fault.kind in {"start_wide", "start_narrow"}:
        width = fault.size
    elif fault.kind == "start_shifted":
        shift = fault.size
    elif fault.kind == "start_negative":
        width = -1.0
    elif fault.kind == "start_nan":
        width = math.nan
    changes: dict[str, float] = {}
    for dof in Dof:
        middle, half = shift * PER_MM[dof], width * float(PLAY[dof]) / 2
        changes[f"{dof.label}.delta_minus"] = middle - half
        changes[f"{dof.label}.delta_plus"] = middle + half
    return config.replace(**changes)
