"""Parallel runs in worker processes, or on a Dask cluster."""

import argparse
import logging
import multiprocessing
import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from typing import TypeVar

from tautscope.commands.printing import progress_bar

Job = TypeVar("Job")
Result = TypeVar("Result")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options that say where runs are computed."""
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1, help="[all cores]")
    parser.add_argument(
        "--scheduler",
        metavar="ADDRESS",
        help="Dask scheduler that distributes the runs, as tcp://host:8786; local:N starts one "
        "with N workers on this computer [processes without Dask]",
    )


class Results(dict[Job, Result]):
    """Results of the finished jobs, in the order of all jobs.

    Attributes:
        missing: Number of jobs that Ctrl-C left unfinished.
    """

    missing = 0

    def require_all(self) -> None:
        """End the program after Ctrl-C: pages state the conditions of a whole campaign.

        Raises:
            SystemExit: A job is not finished.
        """
        if self.missing:
            total = len(self) + self.missing
            raise SystemExit(f"Stopped after {len(self)} of {total} runs: no page is updated.")


def run_until_stopped(
    function: Callable[[Job], Result],
    jobs: Sequence[Job],
    options: argparse.Namespace,
    title: str,
) -> Results[Job, Result]:
    """Run jobs with a progress bar; Ctrl-C ends with those that are finished.

    Args:
        function: As for `run_parallel`.
        jobs: As for `run_parallel`, hashable.
        options: With those of `add_arguments`.
        title: Of the progress bar.

    Raises:
        SystemExit: No job is finished.
    """
    found: dict[Job, Result] = {}
    with progress_bar(title) as show_progress:
        try:
            for job, result in run_parallel(function, jobs, options.workers, options.scheduler):
                found[job] = result
                show_progress(len(found) / len(jobs))
        except KeyboardInterrupt:
            if not found:
                raise SystemExit("Stopped before any run was finished.") from None
    results = Results({job: found[job] for job in jobs if job in found})
    results.missing = len(jobs) - len(found)
    return results


def run_parallel(
    function: Callable[[Job], Result],
    jobs: Iterable[Job],
    workers: int,
    scheduler: str | None = None,
) -> Iterator[tuple[Job, Result]]:
    """Yield each job with its result as soon as a worker finishes it.

    Jobs start in the given order. An error, or Ctrl-C, cancels the jobs that have not started.

    Args:
        function: Importable by the workers, as are the types of jobs and results.
        jobs: One argument each.
        workers: Number of processes.
        scheduler: Address of a Dask scheduler, or ``local:N``, in place of processes. Its workers
            must have this package and `benchmarks` on their path.
    """
    if scheduler is not None:
        yield from _run_on_cluster(function, jobs, scheduler)
        return
    with ProcessPoolExecutor(
        workers, mp_context=multiprocessing.get_context("spawn"), initializer=prepare_worker
    ) as pool:
        running = {pool.submit(function, job): job for job in jobs}
        try:
            for finished in as_completed(running):
                yield running[finished], finished.result()
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise


def _run_on_cluster(
    function: Callable[[Job], Result], jobs: Iterable[Job], scheduler: str
) -> Iterator[tuple[Job, Result]]:
    try:
        from dask import distributed  # noqa: PLC0415  an extra
    except ModuleNotFoundError:
        raise SystemExit("--scheduler needs Dask: uv sync --extra cluster") from None
    place, _, count = scheduler.partition(":")
    if place == "local":
        cluster = distributed.LocalCluster(
            n_workers=int(count or os.cpu_count() or 1),
            threads_per_worker=1,
            dashboard_address=None,
        )
    else:
        cluster = scheduler
    with distributed.Client(cluster) as client:
        try:
            client.register_worker_callbacks(prepare_worker)
            # Not pure: equal jobs are not merged, and nothing is reused from another campaign.
            running = {client.submit(function, job, pure=False): job for job in jobs}
            try:
                for finished in distributed.as_completed(list(running)):
                    job, result = running.pop(finished), finished.result()
                    finished.release()
                    yield job, result
            finally:
                client.cancel(list(running))
        finally:
            if place == "local":
                cluster.close()


def prepare_worker() -> None:
    """Use one thread per process, so that one process per core is the best choice, and log nothing.

    What a loop warns of is in the row of its run.
    """
    logging.getLogger("tautscope").setLevel(logging.ERROR)
    os.environ["OMP_NUM_THREADS"] = "1"
    import cv2  # noqa: PLC0415  the parent process renders no images

    cv2.setNumThreads(1)
