"""One instrument with its loop, from whose state after the estimation all faults start.

The loop first estimates the slack for two strokes. Then the process forks once per fault, so that
every run continues from an identical state of loop and physics, and gives the same results alone
and among others.
"""

import gc
import math
import os
import pickle
import traceback
from collections.abc import Callable, Generator, Sequence
from functools import partial

import numpy as np
from faults import envelopes, evaluation, scenarios
from faults.envelopes import Floats
from faults.evaluation import Outcome, Traces
from faults.operator_input import OBSERVED_STOPPED, InputDevice, OperatorInput, RunFinished
from faults.recorder import RunRecorder
from faults.rigs import FeatureTwin, ProtectedRig
from tautscope.config import Config
from tautscope.errors import TautscopeError
from tautscope.loop.safety import Reaction
from tautscope.runs.experiment import run_experiment
from tautscope.twin.faults import Fault, FaultyReference, FaultyRig, Target


class Instrument:
    """Instrument, loop, drives and operator of one seed.

    Args:
        config: Configuration of loop and twin.
        seed: See `Outcome.seed`.
        off: Detectors that are off; those of the drives are switched off here.
        is_cold: Whether the observation starts at once, without estimation.
    """

    def __init__(
        self, config: Config, seed: int, off: tuple[str, ...] = (), is_cold: bool = False
    ) -> None:
        self._config, self._seed = config, seed
        self._start = 0.0 if is_cold else scenarios.fault_start(config, seed)
        self._twin = FeatureTwin(config)
        self._recorder = RunRecorder(self._clock, self._start, config.control.period)
        periods = {dof: scenarios.PERIODS[dof] for dof in scenarios.moving_dofs(seed)}
        end = self._start + scenarios.OBSERVED_PERMANENT
        self._operator = OperatorInput(config, periods, self._clock, end)
        self._device = InputDevice(self._operator, self._recorder)
        self._rig = ProtectedRig(
            FaultyRig(self._twin, (), seed),
            self._recorder,
            {"following_error", "drive_fault"} - set(off),
            math.inf if is_cold else self._start,
            self._fork_all,
        )
        self._max_motion = np.array(config.safety.reference_speed) * config.control.period
        self._plan: Generator[Callable[[], None], Traces, None] | None = None
        self._pipe: int | None = None

    def run_faults(self, kinds: Sequence[str], longest: float) -> list[Outcome]:
        """Run each kind of fault, `longest` at most, all from the state after the estimation."""
        if not kinds:
            return []
        outcomes: list[Outcome] = []
        self._plan = self._plan_forks(kinds, longest, outcomes)
        try:
            answer = True, self.run()
        except _AllForksFinishedError:
            return outcomes
        except BaseException:
            if self._pipe is None:
                raise
            answer = False, traceback.format_exc()
        with os.fdopen(self._pipe or 0, "wb") as pipe:
            pickle.dump(answer, pipe)
        os._exit(0)

    def run(self) -> Traces:
        """Run to the end; the drives stop if the loop raises an error."""
        recorder, rig = self._recorder, self._rig
        try:
            run_experiment(
                rig,
                self._device,
                self._config,
                look=recorder.update,
                log=recorder,
                engage=lambda _: False,  # `InputDevice` ends the run
            )
        except RunFinished:
            pass
        except TautscopeError as error:
            recorder.record_flag(getattr(error, "field", type(error).__name__), self._clock())
            recorder.record_reaction(self._clock(), Reaction.QUICK_STOP)
            rig.stop()
            for _ in range(round(OBSERVED_STOPPED / self._config.control.period)):
                rig.step(np.zeros(3))
        first = round(self._start / self._config.control.period)
        return Traces(
            np.array(self._twin.truth[first:]),
            np.array(self._twin.commands[first:]),
            recorder.summary(),
            np.array(self._device.intended),
            np.array(self._device.reported),
        )

    def _clock(self) -> float:
        return self._twin.time

    def _plan_forks(
        self, kinds: Sequence[str], longest: float, outcomes: list[Outcome]
    ) -> Generator[Callable[[], None], Traces, None]:
        """Yield what each fork does first, and receive its traces."""
        nominal = yield lambda: None
        for kind in kinds:
            fault = scenarios.draw_fault(kind, self._seed, self._start, longest)
            base, envelope, reported = nominal, None, None
            if kind in evaluation.INPUT_PAUSED:
                base = yield partial(self._pause, fault)
            run = yield partial(self._inject, fault)
            stop = run.summary["stop_tick"]
            distance = evaluation.excursion(run.truth, base.truth, stop)
            if kind in evaluation.MOVES_TIP and (distance > evaluation.TRANSIENT_GOAL).any():
                ticks = round(scenarios.observation_time(fault) / self._config.control.period)
                open_loop = yield partial(self._replay, fault, nominal.commands[:ticks])
                envelope = envelopes.open_loop_envelope(open_loop.truth, base.truth)
            elif fault.row.target is Target.REFERENCE and kind not in evaluation.INPUT_PAUSED:
                reported = envelopes.input_envelope(
                    kind, run.intended, run.reported, self._max_motion
                )
                if kind == "hand_late":
                    delayed = envelopes.delay_envelope(
                        fault, base.truth, self._config.control.period
                    )
                    reported = envelopes.union(reported, delayed)
                envelope = reported
                if (
                    evaluation.excursion(run.truth, base.truth, stop, reported)
                    > evaluation.TRANSIENT_GOAL
                ).any():
                    commands = envelopes.with_input_error(
                        nominal.commands, run.intended, run.reported, stop
                    )
                    open_loop = yield partial(self._replay, Fault("ok"), commands)
                    envelope = envelopes.union(
                        reported, envelopes.open_loop_envelope(open_loop.truth, base.truth)
                    )
            outcomes.append(
                evaluation.evaluate_run(
                    self._seed,
                    fault,
                    run,
                    base,
                    nominal.summary,
                    envelope=envelope,
                    reported=reported,
                )
            )

    def _fork_all(self) -> None:
        """Fork once per run. Only the forks return from here and continue."""
        assert self._plan is not None
        prepare = next(self._plan)
        # Memory that exists now stays shared between the forks.
        gc.collect()
        gc.freeze()
        while True:
            traces = self._fork(prepare)
            if traces is None:
                return
            try:
                prepare = self._plan.send(traces)
            except StopIteration:
                raise _AllForksFinishedError from None

    def _fork(self, prepare: Callable[[], None]) -> Traces | None:
        reading, writing = os.pipe()
        child = os.fork()
        if child == 0:
            os.close(reading)
            gc.disable()
            self._pipe = writing
            prepare()
            return None
        os.close(writing)
        with os.fdopen(reading, "rb") as pipe:
            data = pipe.read()
        os.waitpid(child, 0)
        succeeded, answer = pickle.loads(data) if data else (False, "the forked process died")
        if not succeeded:
            raise RuntimeError(answer)
        assert isinstance(answer, Traces)
        return answer

    def _inject(self, fault: Fault) -> None:
        self._rig.rig = FaultyRig(self._twin, (fault,), self._seed)
        self._device.faulty = FaultyReference(self._operator, (fault,), self._seed)
        self._operator.end = self._start + scenarios.observation_time(fault)

    def _pause(self, fault: Fault) -> None:
        self._operator.pauses = scenarios.input_pauses(fault)
        if fault.row.target is Target.REFERENCE:
            self._operator.paused = [fault.dof]
        self._operator.end = self._start + scenarios.observation_time(fault)

    def _replay(self, fault: Fault, commands: Floats) -> None:
        """Send recorded commands to the physics with a fault."""
        rig = FaultyRig(self._twin, (fault,), self._seed)
        for command in commands:
            rig.step(command)
        self._operator.end = 0.0


class _AllForksFinishedError(Exception):
    """Every fork has finished."""
