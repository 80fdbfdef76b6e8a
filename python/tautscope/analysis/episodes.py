"""The slack in each episode of a data set, and over all of them."""

from __future__ import annotations

import math
import os
from collections import Counter
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from multiprocessing import get_context
from typing import Any

import numpy as np

from tautscope.analysis.verdict import Verdict, judge
from tautscope.errors import RecordError
from tautscope.runs.columns import time_column
from tautscope.runs.episodes import Episode, open_episode
from tautscope.runs.records import read_record
from tautscope.runs.tables import Sheet

CHUNK = 4
"""Episodes that a worker gets at once."""
_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "POLARS_MAX_THREADS")
"""One each in a worker: the matrices are small, and two workers with all threads are slower."""


@dataclass(frozen=True)
class Request:
    """What is read from each episode.

    Attributes:
        folder: Of the data set.
        pairs: Columns of command and tip of each degree of freedom.
        names: Of the degrees of freedom.
        time: Column of the time; None for a column that is called so.
        missing: Values that stand for none.
    """

    folder: str
    pairs: tuple[tuple[str, str], ...]
    names: tuple[str, ...]
    time: str | None
    missing: tuple[float, ...]


@dataclass(frozen=True)
class Summary:
    """The slack of a degree of freedom over all episodes.

    Attributes:
        identified: Episodes in which it is identified.
        aligned: Episodes in which it is 0.
        median: Of the identified widths; NaN without one.
        low: Lower end of the 95 % interval of the median, by the ranks of the widths; NaN below
            six widths.
        high: Its upper end.
        tenth: Tenth percentile of the widths.
        ninetieth: Ninetieth percentile.
        typical: Number of the episode whose width is the median, or next to it; None without one.
        reasons: Why it is not identified in the others: text of one, its episode, and their number.
    """

    identified: int
    aligned: int
    median: float
    low: float
    high: float
    tenth: float
    ninetieth: float
    typical: int | None
    reasons: tuple[tuple[str, int, int], ...]


def judge_all(
    episodes: Sequence[Episode], request: Request, workers: int
) -> Iterator[list[dict[str, Any]]]:
    """A row for each degree of freedom of each episode, in their order, from worker processes."""
    read = partial(judge_episode, request)
    workers = min(workers, -(-len(episodes) // CHUNK))
    if workers <= 1:
        yield from map(read, episodes)
        return
    # Before a worker starts: its libraries read them when they are loaded.
    os.environ |= dict.fromkeys(_THREADS, "1")
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        try:
            yield from pool.map(read, episodes, chunksize=CHUNK)
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise


def judge_episode(request: Request, episode: Episode) -> list[dict[str, Any]]:
    """A row for each degree of freedom; what an episode lacks is in its row."""
    rows = []
    for name, (command, tip) in zip(request.names, request.pairs, strict=True):
        row: dict[str, Any] = {"episode": episode.number, "name": name}
        try:
            sheet = open_episode(request.folder, episode)
            row |= _row(_verdict(sheet, command, tip, request))
        except RecordError as error:
            row |= {"identified": False, "aligned": False, "missing": str(error)}
        rows.append(row)
    return rows


def _verdict(sheet: Sheet, command: str, tip: str, request: Request) -> Verdict:
    time = request.time or time_column(sheet.titles)
    record = read_record(sheet, command, tip, time, missing=request.missing)
    return judge(record, columns=(command, tip))


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


def summarize(rows: Sequence[dict[str, Any]]) -> Summary:
    """The slack over the rows of one degree of freedom."""
    known = sorted((row["width"], row["episode"]) for row in rows if row["identified"])
    widths = np.array([width for width, _ in known])
    low, high = _median_interval(widths)
    others = [row for row in rows if not row["identified"] and not row["aligned"]]
    kinds = [_kind(row["missing"]) for row in others]
    reasons = []
    for kind, count in Counter(kinds).most_common():
        first = others[kinds.index(kind)]
        reasons.append((first["missing"], first["episode"], count))
    tenth, median, ninetieth = (
        np.quantile(widths, (0.1, 0.5, 0.9)) if known else (np.nan, np.nan, np.nan)
    )
    return Summary(
        identified=len(known),
        aligned=sum(row["aligned"] for row in rows),
        median=float(median),
        low=low,
        high=high,
        tenth=float(tenth),
        ninetieth=float(ninetieth),
        typical=known[len(known) // 2][1] if known else None,
        reasons=tuple(reasons),
    )


def _median_interval(ordered: np.ndarray[Any, np.dtype[np.float64]]) -> tuple[float, float]:
    """Distribution-free interval of at least 95 %: between the k-th values from both ends."""
    count = len(ordered)
    shares = np.cumsum([math.comb(count, each) / 2**count for each in range(count + 1)])
    k = int(np.searchsorted(shares, 0.025, side="right"))
    return (float(ordered[k - 1]), float(ordered[count - k])) if k > 0 else (np.nan, np.nan)


def _kind(text: str) -> str:
    """A text without what differs between episodes."""
    return "".join(letter for letter in text if not letter.isdigit())
