"""Results of the bench as tables of docs/hardware.md."""

from collections.abc import Iterator
from typing import Any

ROWS = {
    "set-point later than due": "jitter_ms",
    "set-point to answers": "answer_ms",
    "age of a frame when used": "frame_age_ms",
}


def tables(document: dict[str, Any]) -> Iterator[str]:
    """Yield the lines of all tables."""
    yield from _commissioning(document)
    yield from _punctuality(document.get("run", {}))
    yield from _replays(document.get("replays", {}))
    yield from _reductions(document.get("reductions", {}))
    yield from _stops([*document.get("faults", []), *document.get("wrong", [])])


def _commissioning(document: dict[str, Any]) -> Iterator[str]:
    """Yield what was found before the first run."""
    if "missing" in document:
        yield f"\ndoctor: {', '.join(document['missing']) or 'All there'}"
    for stop in document.get("stops", []):
        yield f"stop of insertion: {1e3 * stop['found']:.2f} mm, true {1e3 * stop['true']:.2f} mm"
    if found := document.get("geometry"):
        yield f"geometry: residual {found['residual']:.2g} px"
    for row in document.get("owners", []):
        missing = ", ".join(row["missing"]) or "All there"
        yield (
            f"\n{row['drives']}: {row['minutes']:.1f} min; doctor: {missing}; jog by 1 mm: "
            f"{1e3 * row['moved']:.2f} mm; {', '.join(row['done'])}; {row['said'] or 'no error'}"
        )
        yield from (f"- {note}" for note in row["motion"])


def _punctuality(runs: dict[str, Any]) -> Iterator[str]:
    """Yield the timing of each run."""
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
    observable = [
        ", ".join(f"{100 * share:.1f}" for share in part["observable"].values()) + " %"
        for part in runs.values()
    ]
    yield f"| frames that show insertion, rotation, bending | {' | '.join(observable)} | |"


def _replays(found: dict[str, Any]) -> Iterator[str]:
    """Yield whether each replay is identical."""
    for name, row in found.items():
        verdict = "identical to the bit" if row["identical"] else f"differs: {row['said']}"
        ticks, updates = row["ticks"], row["updates"]
        yield f"\nReplay, {name}: {ticks} ticks, {updates} image updates, {verdict}"


def _reductions(found: dict[str, Any]) -> Iterator[str]:
    """Yield the reductions on the bench and of the in-process twin."""
    if not found:
        return
    yield "\n| reduction of mean width, true tip | bench | in-process twin | difference | goal |"
    yield "|---|---|---|---|---|"
    for dof, row in found.items():
        difference = 100 * abs(row["bench"] - row["in_process"])
        verdict = "" if row["holds"] else ", missed"
        yield (
            f"| {dof} | {100 * row['bench']:.1f} % | {100 * row['in_process']:.1f} % "
            f"| {difference:.1f} points | 3{verdict} |"
        )


def _stops(rows: list[dict[str, Any]]) -> Iterator[str]:
    """Yield what failed, how soon the run ended, and its message."""
    if not rows:
        return
    yield "\n| failure | time | as it must | exit status | message |\n|---|---|---|---|---|"
    for row in rows:
        took = "" if row["ms"] is None else f"{row['ms']:.3g} ms"
        status = "" if row["status"] is None else row["status"]
        holds = "yes" if row.get("holds", True) else "no"
        yield f"| {row['what']} | {took} | {holds} | {status} | {row['said']} |"
