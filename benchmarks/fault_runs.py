"""Runs with a fault, all of a seed from one warm instrument.

The loop learns the slack in two strokes; then the process forks, once for every fault, so that each
run goes on from the very same state of loop and physics, whatever that state consists of. A run
alone gives the figures it gives among others.
"""

from __future__ import annotations

import gc
import math
import os
import pickle
import traceback
from collections.abc import Callable, Generator, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from fault_bands import Floats, as_late, as_told, by_itself, by_the_hand, wider
from fault_draws import (
    PERIODS,
    STARTS,
    WATCHED_FOR_GOOD,
    began,
    configured,
    drawn,
    moving,
    pauses,
    told,
    watched,
)
from fault_hand import AllSeen, Device, Hand
from fault_judgement import HELD, MOVED, PASSING, Outcome, Traces, excursion, outcome
from fault_watch import STILL, Driven, FeatureTwin, Watch
from tautscope.config import Config, Profile
from tautscope.errors import ConfigError, TautscopeError
from tautscope.loop.safety import DETECTORS, Reaction
from tautscope.runs.experiment import run_experiment
from tautscope.twin.faults import Fault, FaultyReference, FaultyRig, Target


def study(
    seed: int, kinds: Sequence[str], profile: Profile = "best", off: tuple[str, ...] = ()
) -> list[Outcome]:
    """The runs of one seed."""
    config = configured(seed, profile, off)
    begun = begun_with(config, seed, [kind for kind in kinds if kind in STARTS])
    warm = [kind for kind in kinds if kind not in STARTS]
    return begun + (Instrument(config, seed, off).runs(warm) if warm else [])


def each_off(
    seed: int, kinds: Sequence[str], profile: Profile = "best"
) -> dict[str, list[Outcome]]:
    """The runs of one seed with each detector off in turn.

    A detector that says nothing, neither with the fault nor without, changes no bit, and switched
    off it changes none either: the run with all of them on stands for it.
    """
    guarded = study(seed, kinds, profile)
    found = {}
    for name in DETECTORS:
        spoke = [each.kind for each in guarded if name in each.raised]
        again = {each.kind: each for each in study(seed, spoke, profile, (name,))}
        # It spoke in the run that stands for it, and can no longer.
        found[name] = [
            replace(again[each.kind], raised=each.raised) if each.kind in again else each
            for each in guarded
        ]
    return found


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
            {"following_error", "drive_fault"} - set(off),
            math.inf if cold else self._since,
            self._branch,
        )
        self._reach = np.array(config.safety.reference_speed) * config.control.period
        self._plan: Generator[Callable[[], None], Traces, None] | None = None
        self._pipe: int | None = None

    def runs(self, kinds: Sequence[str]) -> list[Outcome]:
        """One run for each kind, all from the state after learning."""
        if not kinds:
            return []
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
        except AllSeen:
            pass
        except TautscopeError as error:
            watch.raised(getattr(error, "field", type(error).__name__), self._clock())
            watch.note(self._clock(), Reaction.QUICK_STOP)
            driven.stop()
            for _ in range(round(STILL / self._config.control.period)):
                driven.step(np.zeros(3))
        return self._traces()

    def _clock(self) -> float:
        return self._twin.time

    def _traces(self) -> Traces:
        first = round(self._since / self._config.control.period)
        truth, commands = self._twin.truth[first:], self._twin.commands[first:]
        meant, device = np.array(self._device.meant), np.array(self._device.told)
        return Traces(np.array(truth), np.array(commands), self._watch.said(), meant, device)

    def _planned(
        self, kinds: Sequence[str], outcomes: list[Outcome]
    ) -> Generator[Callable[[], None], Traces, None]:
        """What each fork begins with; it is sent what came of it."""
        nominal = yield lambda: None
        for kind in kinds:
            fault = drawn(kind, self._seed, self._since)
            base, band, asked = nominal, None, None
            if kind in HELD:
                base = yield partial(self._pause, fault)
            found = yield partial(self._fail, fault)
            far = excursion(found.truth, base.truth, found.said["stop_tick"])
            if kind in MOVED and (far > PASSING).any():
                alone = yield partial(self._replay, fault, nominal.commands[: self._ticks(fault)])
                band = by_itself(alone.truth, base.truth)
            elif fault.row.target is Target.REFERENCE and kind not in HELD:
                stop = found.said["stop_tick"]
                band = asked = by_the_hand(kind, found.meant, found.told, self._reach)
                if kind == "hand_late":
                    late = as_late(fault, base.truth, self._config.control.period)
                    band = asked = wider(asked, late)
                if (excursion(found.truth, base.truth, stop, asked) > PASSING).any():
                    bare = as_told(nominal.commands, found.meant, found.told, stop)
                    alone = yield partial(self._replay, Fault("ok"), bare)
                    swung = by_itself(alone.truth, base.truth)
                    band = wider(asked, swung)
            outcomes.append(
                outcome(self._seed, fault, found, base, nominal.said, band=band, asked=asked)
            )

    def _branch(self) -> None:
        """Every fork returns from here and goes on; we never do."""
        assert self._plan is not None
        begin = next(self._plan)
        # What is there stays shared between the forks.
        gc.collect()
        gc.freeze()
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
            gc.disable()
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
        self._device.faulty = FaultyReference(self._hand, (fault,), self._seed)
        self._hand.end = self._since + watched(fault)

    def _pause(self, fault: Fault) -> None:
        self._hand.pauses = pauses(fault)
        if fault.row.target is Target.REFERENCE:
            self._hand.paused = [fault.dof]
        self._hand.end = self._since + watched(fault)

    def _ticks(self, fault: Fault) -> int:
        return round(watched(fault) / self._config.control.period)

    def _replay(self, fault: Fault, commands: Floats) -> None:
        """The same physics, with these commands."""
        rig = FaultyRig(self._twin, (fault,), self._seed)
        for command in commands:
            rig.step(command)
        self._hand.end = 0.0


class _AllDoneError(Exception):
    """Every fork has answered."""


def begun_with(config: Config, seed: int, kinds: Sequence[str]) -> list[Outcome]:
    """From the first tick on, against the loop that is told the right slack."""
    found: list[Outcome] = []
    base: Traces | None = None
    for kind in kinds:
        fault = drawn(kind, seed, 0.0)
        try:
            wrong = told(config, fault)
        except ConfigError:
            found.append(refused(config, seed, fault))
            continue
        if base is None:
            base = Instrument(told(config, Fault("ok")), seed, cold=True).run()
        begun = Instrument(wrong, seed, cold=True).run()
        found.append(outcome(seed, fault, begun, base, base.said))
    return found


def refused(config: Config, seed: int, fault: Fault) -> Outcome:
    """It never came to move."""
    nothing = np.zeros((0, 3))
    said = Watch(lambda: 0.0, 0.0, config.control.period)
    said.raised("ConfigError", 0.0)
    said.note(0.0, Reaction.DISABLE)
    traces = Traces(nothing, nothing, said.said(), nothing, nothing)
    return outcome(seed, fault, traces, None, {"flags": {}})
