"""Parallel runs in worker processes."""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from typing import TypeVar

Job = TypeVar("Job")
Result = TypeVar("Result")


def run_parallel(
    function: Callable[[Job], Result], jobs: Iterable[Job], workers: int
) -> Iterator[tuple[Job, Result]]:
    """Yield each job with its result as soon as a worker process finishes it.

    Jobs start in the given order. An error, or Ctrl-C, cancels the jobs that have not started.
    """
    with ProcessPoolExecutor(
        workers, mp_context=multiprocessing.get_context("spawn"), initializer=limit_threads
    ) as pool:
        running = {pool.submit(function, job): job for job in jobs}
        try:
            for finished in as_completed(running):
                yield running[finished], finished.result()
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise


def limit_threads() -> None:
    """Use one thread per process, so that one process per core is the best choice."""
    os.environ["OMP_NUM_THREADS"] = "1"
    import cv2  # noqa: PLC0415  the parent process renders no images

    cv2.setNumThreads(1)
