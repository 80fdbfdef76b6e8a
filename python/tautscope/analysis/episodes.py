"""The slack in each episode of a data set, and over all of them."""

import os
import re
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import get_context
from typing import Any

import numpy as np

from tautscope.analysis.models.task import Floats
from tautscope.analysis.verdict import Verdict, judge
from tautscope.errors import TautscopeError
from tautscope.runs.columns import time_column
from tautscope.runs.episodes import Episode, open_episode
from tautscope.runs.records import read_record

CHUNK = 4
"""Episodes that a worker gets at once."""
_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "POLARS_MAX_THREADS")
"""One each in a worker: the matrices are small, and two workers with all threads are slower."""


Rows = list[dict[str, Any]]
"""A row for each degree of freedom of an episode."""


def judge_all(
    episodes: Sequence[Episode], judge_one: Callable[[Episode], Rows], workers: int
) -> Iterator[Rows]:
    """Rows of each episode, in their order, from worker processes."""
    workers = min(workers, -(-len(episodes) // CHUNK))
    if workers <= 1:
        yield from map(judge_one, episodes)
        return
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        try:
            with _one_thread_each():  # the workers start in `map`
                found = pool.map(judge_one, episodes, chunksize=CHUNK)
            yield from found
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise


@contextmanager
def _one_thread_each() -> Iterator[None]:
    """Let processes that start in the block use one thread: libraries read it when loaded."""
    before = {name: os.environ.get(name) for name in _THREADS}
    os.environ |= dict.fromkeys(_THREADS, "1")
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


def judge_episode(
    folder: str,
    pairs: Mapping[str, tuple[str, str]],
    time: str | None,
    missing: Sequence[float],
    episode: Episode,
) -> Rows:
    """Judge the columns of command and tip of each degree of freedom of an episode in a folder.

    What an episode lacks is in its row. Without a time it is in the column that is called so.
    """
    rows, sheet = [], None
    for name, (command, tip) in pairs.items():
        row: dict[str, Any] = {"episode": episode.number, "name": name}
        try:
            sheet = sheet or open_episode(folder, episode)
            at = time or time_column(sheet.titles)
            record = read_record(sheet, command, tip, at, missing=missing)
            row |= _row(judge(record, columns=(command, tip)))
        except TautscopeError as error:
            row |= {"identified": False, "aligned": False, "missing": str(error)}
        rows.append(row)
    return rows


def _row(verdict: Verdict) -> dict[str, Any]:
    found = verdict.to_json()
    low, high = found["interval"] or (None, None)
    delay_low, delay_high = found["delay_interval"] or (None, None)
    effect = found["compensation"] or {}
    names = ("identified", "aligned", "width", "delay", "gain", "noise", "strokes", "missing")
    return {name: found[name] for name in names} | {
        "width_low": low,
        "width_high": high,
        "delay_low": delay_low,
        "delay_high": delay_high,
        "error_before": effect.get("before"),
        "error_after": effect.get("after"),
        "samples": len(verdict.record.rows),
        "findings": "; ".join(map(str, verdict.findings)),
    }


def summarize(rows: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """The slack over the rows of one degree of freedom, as in ``tautscope analyze --json``.

    Returns:
        ``identified`` and ``aligned``: number of episodes in which it is identified, and is 0. Of
        the identified widths, None without one: ``median``; ``low`` and ``high``, the 95 % interval
        of the median by their ranks, None below six; ``tenth`` and ``ninetieth`` percentile;
        ``typical``, the number of the episode whose width is the median, or next to it. ``reasons``
        why it is not identified in the others: text of one (``missing``), its ``episode``, and
        their ``count``.
    """
    known = sorted((row["width"], row["episode"]) for row in rows if row["identified"])
    widths = np.array([width for width, _ in known])
    others = [row for row in rows if not row["identified"] and not row["aligned"]]
    kinds = [_kind(row["missing"]) for row in others]
    reasons = [
        {name: others[kinds.index(kind)][name] for name in ("missing", "episode")}
        | {"count": count}
        for kind, count in Counter(kinds).most_common()
    ]
    shares = {"median": 0.5, "tenth": 0.1, "ninetieth": 0.9}
    low, high = _median_interval(widths)
    return {
        "identified": len(known),
        "aligned": sum(row["aligned"] for row in rows),
        "low": low,
        "high": high,
        **{name: float(np.quantile(widths, at)) if known else None for name, at in shares.items()},
        "typical": known[len(known) // 2][1] if known else None,
        "reasons": reasons,
    }


def _median_interval(ordered: Floats) -> tuple[float, float] | tuple[None, None]:
    """Distribution-free interval of at least 95 %: between the k-th values from both ends."""
    from scipy.stats import binom  # noqa: PLC0415

    count = len(ordered)
    k = int(binom.ppf(0.025, count, 0.5))
    return (float(ordered[k - 1]), float(ordered[count - k])) if k > 0 else (None, None)


def _kind(text: str) -> str:
    """A text without its numbers, which differ between episodes."""
    return re.sub(r"[-+]?\d+(\.\d+)?(e[-+]?\d+)?", "N", text)
