"""What benchmarks/bench.py found, as tables of docs/hardware.md."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

ROWS = {
    "set-point later than due": "jitter_ms",
    "set-point to answers": "answer_ms",
    "age of a frame when used": "frame_age_ms",
}


def tables(document: dict[str, Any]) -> Iterator[str]:
    """All of a document of benchmarks/bench.py."""
    yield from _punctuality(document.get("run", {}))
    yield from _replays(document.get("replays", {}))
    yield from _reductions(document.get("reductions", {}))
    yield from _stops([*document.get("faults", []), *document.get("wrong", [])])


def _punctuality(runs: dict[str, Any]) -> Iterator[str]:
    """Cycles and frames of each run."""
    if not runs:
        return
    timings = [part["timing"] for part in runs.values()]
    yield f"\n| what | {' | '.join(runs)} | goal |\n|{'---|' * (len(runs) + 2)}"
    lost = [f"{one['lost_cycles']} of {one['cycles']}" for one in timings]
    yield f"| cycles lost | {' | '.join(lost)} | 0 |"
    for title, name in ROWS.items():
        cells = [
            ", ".join(f"{one[name][which]:.3g}" for which in ("median", "p99", "worst")) + " ms"
            for one in timings
        ]
        yield f"| {title}: median, 99 %, worst | {' | '.join(cells)} | |"
    seen = [
        ", ".join(f"{100 * share:.1f}" for share in part["observable"].values()) + " %"
        for part in runs.values()
    ]
    yield f"| frames that show insertion, rotation, bending | {' | '.join(seen)} | |"


def _replays(found: dict[str, Any]) -> Iterator[str]:
    """Whether each log gives the same again."""
    for name, row in found.items():
        verdict = "bit for bit" if row["identical"] else f"differs: {row['said']}"
        ticks, updates = row["ticks"], row["updates"]
        yield f"\nReplay, {name}: {ticks} ticks, {updates} image updates, {verdict}"


def _reductions(found: dict[str, Any]) -> Iterator[str]:
    """The bench's beside the in-process twin's."""
    if not found:
        return
    yield "\n| reduction of the mean width, true tip | bench | in the process | apart | goal |"
    yield "|---|---|---|---|---|"
    for dof, row in found.items():
        apart = 100 * abs(row["bench"] - row["in_process"])
        verdict = "" if row["holds"] else ", missed"
        yield (
            f"| {dof} | {100 * row['bench']:.1f} % | {100 * row['in_process']:.1f} % "
            f"| {apart:.1f} points | 3{verdict} |"
        )


def _stops(rows: list[dict[str, Any]]) -> Iterator[str]:
    """What went wrong, how soon it ended, and what was said."""
    if not rows:
        return
    yield "\n| what | time | goal | exit status | said |\n|---|---|---|---|---|"
    for row in rows:
        took = "" if row["ms"] is None else f"{row['ms']:.3g} ms"
        status = "" if row["status"] is None else row["status"]
        limit = row.get("limit_ms")
        goal = "" if limit is None else f"{limit:g} ms"
        goal += "" if row.get("holds", True) else " missed"
        yield f"| {row['what']} | {took} | {goal} | {status} | {row['said']} |"
