"""Many runs at once, each in a process of its own."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, wait
from dataclasses import dataclass
from multiprocessing import get_context
from typing import Any

from tautscope.config import Config
from tautscope.loop.references import SineSequence
from tautscope.loop.rig import Rig
from tautscope.runs.experiment import run_experiment
from tautscope.runs.recording import Recording

RigMaker = Callable[[Config], Rig]


@dataclass(frozen=True, slots=True)
class Trial:
    """One run of the article's protocol."""

    config: Config
    compensate: bool


class _StoppedError(Exception):
    """Another run failed, or the person does not want to wait any longer."""


def make_twin(config: Config) -> Rig:
    """The twin of a configuration."""
    from tautscope.twin import Twin  # noqa: PLC0415  MuJoCo is loaded by those who use it

    return Twin(config)


def run_trials(
    trials: Sequence[Trial],
    progress: Callable[[float], None],
    make_rig: RigMaker = make_twin,
    workers: int | None = None,
) -> list[Recording]:
    """Run every trial; recordings in the order of the trials, whatever the number of workers.

    Args:
        trials: What to run.
        progress: Told the share of all work done, 0 to 1.
        make_rig: Makes a trial's rig; a function that workers can import.
        workers: Processes; without it one per processor.

    Raises:
        TautscopeError: The first one a run raises; the others are stopped.
    """
    context = get_context("spawn")
    news, stop = context.SimpleQueue(), context.Event()
    done = [0.0] * len(trials)
    with ProcessPoolExecutor(
        min(workers or os.cpu_count() or 1, len(trials)),
        mp_context=context,
        initializer=_start_worker,
        initargs=(news, stop),
    ) as pool:
        try:
            runs = [pool.submit(_run, index, trial, make_rig) for index, trial in enumerate(trials)]
            pending: set[Future[Recording]] = set(runs)
            while pending:
                finished, pending = wait(pending, timeout=0.1)
                while not news.empty():
                    index, share = news.get()
                    done[index] = share
                progress(sum(done) / len(done))
                for run in finished:
                    run.result()
        except BaseException:
            stop.set()
            pool.shutdown(cancel_futures=True)
            raise
    return [run.result() for run in runs]


_channel: Any = None


def _start_worker(news: Any, stop: Any) -> None:
    import cv2  # noqa: PLC0415  only workers and those who ask for pictures load OpenCV

    global _channel  # noqa: PLW0603  a worker has one channel for its life
    _channel = (news, stop)
    cv2.setNumThreads(1)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent decides, and tells through `stop`


def _run(index: int, trial: Trial, make_rig: RigMaker) -> Recording:
    news, stop = _channel

    def tell(elapsed: float, duration: float) -> None:
        if stop.is_set():
            raise _StoppedError
        news.put((index, min(elapsed / duration, 1.0)))

    rig = make_rig(trial.config)
    try:
        reference = SineSequence(trial.config.experiment)
        return run_experiment(rig, reference, trial.config, trial.compensate, tell)
    finally:
        rig.close()
