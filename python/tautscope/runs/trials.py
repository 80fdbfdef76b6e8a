"""Parallel runs, each in its own process."""

import os
import signal
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, wait
from dataclasses import dataclass
from multiprocessing import get_context
from typing import Any

from tautscope.config import Config
from tautscope.loop.references import Reference, SineSequence
from tautscope.loop.rig import Rig
from tautscope.runs.experiment import run_experiment
from tautscope.runs.recording import Recording


@dataclass(frozen=True, slots=True)
class Trial:
    """One run; its motion None is the article's protocol. Without images the twin is faster."""

    config: Config
    compensate: bool
    motion: Reference | None = None
    images: bool = True


RigMaker = Callable[[Trial], Rig]


class _StoppedError(Exception):
    """Another run failed, or the user interrupted."""


def make_twin(trial: Trial) -> Rig:
    """The twin of a trial."""
    from tautscope.twin import Twin  # noqa: PLC0415  MuJoCo is loaded only when used

    return Twin(trial.config, images=trial.images)


def run_trials(
    trials: Sequence[Trial],
    progress: Callable[[float], None],
    make_rig: RigMaker = make_twin,
    workers: int | None = None,
) -> list[Recording]:
    """Run every trial; the recordings are in the order of the trials.

    Args:
        trials: The runs.
        progress: Called with the share of all work done, 0 to 1.
        make_rig: Makes the rig of a trial; a function that workers can import.
        workers: Number of processes; by default one per processor.

    Raises:
        TautscopeError: The first error of a run; the other runs are stopped.
    """
    context = get_context("spawn")
    shares, stop = context.SimpleQueue(), context.Event()
    done = [0.0] * len(trials)
    with ProcessPoolExecutor(
        min(workers or os.cpu_count() or 1, len(trials)),
        mp_context=context,
        initializer=_start_worker,
        initargs=(shares, stop),
    ) as pool:
        try:
            runs = [pool.submit(_run, index, trial, make_rig) for index, trial in enumerate(trials)]
            pending: set[Future[Recording]] = set(runs)
            while pending:
                finished, pending = wait(pending, timeout=0.1)
                while not shares.empty():
                    index, share = shares.get()
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


def _start_worker(shares: Any, stop: Any) -> None:
    import cv2  # noqa: PLC0415  OpenCV is loaded only when used

    global _channel  # noqa: PLW0603  one channel per worker process
    _channel = (shares, stop)
    cv2.setNumThreads(1)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent process sets `stop`


def _run(index: int, trial: Trial, make_rig: RigMaker) -> Recording:
    shares, stop = _channel

    def report(elapsed: float, duration: float) -> None:
        if stop.is_set():
            raise _StoppedError
        shares.put((index, min(elapsed / duration, 1.0)))

    rig = make_rig(trial)
    try:
        reference = trial.motion or SineSequence(trial.config.experiment)
        return run_experiment(rig, reference, trial.config, trial.compensate, report)
    finally:
        rig.close()
