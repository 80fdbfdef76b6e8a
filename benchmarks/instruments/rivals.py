"""`best` beside visual servoing and constant compensation, for latencies and losses of images.

On drawn instruments under an operator's motion, with true features and noise in place of images.

    uv run python benchmarks/instruments/rivals.py --instruments 10 --latency 0.08 --loss 0.2

`--tune` prints the reductions on the tuning instruments by gain, for the constants below.
"""

import argparse
import json
import sys
from collections.abc import Mapping, Sequence
from itertools import product
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np
from common.doc_pages import insert
from common.paths import ROOT
from common.processes import add_arguments, run_until_stopped
from common.rows import goal_row
from instruments.rival_runs import NAMES, Name, RivalFigures, RivalRun, Triple, simulate
from numpy.typing import NDArray
from tautscope.dof import Dof

Floats = NDArray[np.float64]
LATENCIES, LOSSES = (0.02, 0.08, 0.25), (0.0, 0.2, 0.5)
INSTRUMENTS, FIRST_SEED = 20, 3500
PAGE = ROOT / "docs" / "instruments.md"
RIVALS: tuple[Name, ...] = ("visual servoing", "constant compensation")

TUNING_SEEDS, TUNING_DURATION = range(1000, 1010), 60.0
RATES: dict[float, tuple[Triple, ...]] = {
    0.02: ((3.0, 3.0, 3.0), (4.0, 4.0, 4.0), (6.0, 3.0, 4.0), (6.0, 6.0, 4.0), (8.0, 8.0, 8.0)),
    0.08: ((3.0, 3.0, 3.0), (4.0, 3.0, 3.0), (3.0, 4.0, 3.0), (4.0, 4.0, 4.0), (6.0, 6.0, 4.0)),
    0.25: ((1.0, 1.0, 1.0), (2.0, 2.0, 2.0), (3.0, 2.0, 3.0), (3.0, 3.0, 3.0)),
}
"""Rates of visual servoing that `--tune` compares, by latency [1/s]."""
FREE_GAINS: tuple[Triple, ...] = tuple((gain, gain, gain) for gain in (5.0, 10.0, 20.0))
SERVOING: dict[float, Triple] = {
    0.02: (6.0, 3.0, 4.0),
    0.08: (4.0, 3.0, 3.0),
    0.25: (2.0, 2.0, 2.0),
}
"""Rates of visual servoing per latency [1/s]: the best median reductions of `--tune` among rates
with which no instrument is worse than without compensation."""
FREE_GAIN: Triple = (5.0, 5.0, 20.0)
"""Free gains of constant compensation: the best median reduction of `--tune`."""

Found = Mapping[RivalRun, RivalFigures]


def gains_of(name: Name, latency: float) -> Triple:
    """Return the tuned gains; of visual servoing those of the nearest latency."""
    if name == "constant compensation":
        return FREE_GAIN
    return SERVOING[min(SERVOING, key=lambda known: abs(known - latency))]


def plan(
    seeds: Sequence[int], latencies: Sequence[float], losses: Sequence[float], duration: float
) -> list[RivalRun]:
    """Return all runs; what has no images is run once per instrument."""
    runs = []
    for seed, name, latency, loss in product(seeds, NAMES, latencies, losses):
        uses_images = name in ("best", "visual servoing")
        cell = (latency, loss) if uses_images else (latencies[0], losses[0])
        runs.append(RivalRun(seed, name, *cell, gains_of(name, latency), duration))
    return list(dict.fromkeys(_normal(run) for run in runs))


def _normal(run: RivalRun) -> RivalRun:
    """Return the run with gains that do not matter left out."""
    if run.name in RIVALS:
        return run
    return RivalRun(run.seed, run.name, run.latency, run.loss, (0.0, 0.0, 0.0), run.duration)


def values(
    found: Found, name: Name, quantity: str, latency: float, loss: float
) -> dict[int, list[float]]:
    """Values per seed of a controller in a cell; what has no images has one for all cells."""
    return {
        run.seed: getattr(figures, quantity)
        for run, figures in found.items()
        if run.name == name
        and (
            run.name not in ("best", "visual servoing")
            or (run.latency, run.loss) == (latency, loss)
        )
    }


def reductions(found: Found, name: Name, latency: float, loss: float) -> Floats:
    """(seeds, 3) reductions of the spread against the runs without compensation."""
    free = values(found, "none", "spread", latency, loss)
    own = values(found, name, "spread", latency, loss)
    seeds = sorted(set(free) & set(own))
    rows = [1 - np.divide(own[seed], free[seed]) for seed in seeds]
    return np.array(rows).reshape(-1, 3)


def creeps(found: Found, name: Name, latency: float, loss: float) -> Floats:
    """(seeds, 3) travels of the tip while every reference rests."""
    own = values(found, name, "creep", latency, loss)
    return np.array([own[seed] for seed in sorted(own)]).reshape(-1, 3)


def to_rows(
    found: Found, latencies: Sequence[float], losses: Sequence[float]
) -> list[dict[str, Any]]:
    """Rows per cell, rival and DOF: by how much `best` is ahead in the median."""
    rows = []
    for latency, loss, rival, dof in product(latencies, losses, RIVALS, Dof):
        cell = f"{1e3 * latency:g} ms, loss {loss:.0%}"
        mine, other = (reductions(found, name, latency, loss) for name in ("best", rival))
        rests, moves = (creeps(found, name, latency, loss) for name in ("best", rival))
        for what, unit, ahead, count in (
            ("reduction above", "share", np.median(mine[:, dof]) - np.median(other[:, dof]), mine),
            (
                "creep below",
                "m" if dof is Dof.INSERTION else "rad",
                np.median(moves[:, dof]) - np.median(rests[:, dof]),
                rests,
            ),
        ):
            row = goal_row(
                f"{cell}: {what} {rival}'s",
                unit,
                [float(ahead)],
                0.0,
                "min",
                dof=dof.label,
                profile="best",
                n=len(count),
            )
            rows.append(row | {"latency": latency, "loss": loss, "rival": rival})
    return rows


def table(found: Found, latencies: Sequence[float], losses: Sequence[float]) -> str:
    """Return a Markdown table: per cell the median reductions, and the median travels at rest."""
    lines = [
        "| latency | loss | quantity | best | visual servoing | constant compensation | none |",
        "|--:|--:|---|--:|--:|--:|--:|",
    ]
    for latency, loss in product(latencies, losses):
        cell = f"{1e3 * latency:g} ms | {loss:.0%}"
        medians = {
            name: 100 * np.median(reductions(found, name, latency, loss), axis=0)
            for name in ("best", *RIVALS)
        }
        texts = [" / ".join(f"{value:.0f}" for value in each) for each in medians.values()]
        lines.append(f"| {cell} | reduction, % | {' | '.join(texts)} | |")
        rests = []
        for name in ("best", *RIVALS, NAMES[0]):
            travel = np.median(creeps(found, name, latency, loss), axis=0)
            rests.append(" / ".join(f"{dof.display_scale * travel[dof]:.2g}" for dof in Dof))
        lines.append(f"| {cell} | creep | {' | '.join(rests)} |")
    return "\n".join(lines)


def tuning_table(options: argparse.Namespace) -> str:
    """Return median and worst reductions on the tuning instruments, by latency and gain [%]."""
    first = next(iter(RATES))
    kinds: list[tuple[Name, float, Triple]] = [("none", first, (0.0, 0.0, 0.0))]
    kinds += [("constant compensation", first, gains) for gains in FREE_GAINS]
    kinds += [("visual servoing", late, rate) for late, rates in RATES.items() for rate in rates]
    runs = [
        RivalRun(seed, name, latency, 0.0, gains, TUNING_DURATION, rest=0.0)
        for name, latency, gains in kinds
        for seed in TUNING_SEEDS
    ]
    found = run_until_stopped(simulate, runs, options, "rivals")
    lines = ["| controller | latency | gain | reduction | worst |", "|---|--:|--:|--:|--:|"]
    for name, latency, gains in kinds[1:]:
        own = {
            run: figures
            for run, figures in found.items()
            if run.name == "none" or (run.name, run.latency, run.gains) == (name, latency, gains)
        }
        each = 100 * reductions(own, name, latency, 0.0)
        median, worst = (
            " / ".join(f"{value:.0f}" for value in values)
            for values in (np.median(each, axis=0), each.min(axis=0))
        )
        shown = " / ".join(f"{gain:g}" for gain in gains)
        lines.append(f"| {name} | {1e3 * latency:g} ms | {shown} | {median} | {worst} |")
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--instruments", type=int, default=INSTRUMENTS, help="[%(default)s]")
    parser.add_argument("--first-seed", type=int, default=FIRST_SEED, help="[%(default)s]")
    parser.add_argument("--latency", type=float, action="append", help="only this one [all, s]")
    parser.add_argument("--loss", type=float, action="append", help="only this share [all]")
    parser.add_argument("--duration", type=float, default=120.0, help="of a run [%(default)s s]")
    parser.add_argument("--tune", action="store_true", help="measure the gains of the rivals")
    add_arguments(parser)
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    parser.add_argument("--write", action="store_true", help=f"update {PAGE.relative_to(ROOT)}")
    options = parser.parse_args()
    if options.write and (options.latency or options.loss or options.tune):
        parser.error("--write updates the whole table: use it without --latency, --loss and --tune")
    if options.tune:
        print(tuning_table(options))
        return
    cells = options.latency or LATENCIES, options.loss or LOSSES
    seeds = range(options.first_seed, options.first_seed + options.instruments)
    runs = plan(seeds, *cells, options.duration)
    found = run_until_stopped(simulate, runs, options, "rivals")
    shown = table(found, *cells)
    if options.json:
        rows = to_rows(found, *cells)
        print(json.dumps({"rows": rows, "seeds": list(seeds), "table": shown}))
    else:
        print(shown)
    found.require_all()
    if options.write:
        text = f"Seeds {seeds[0]} to {seeds[-1]}, true features with noise.\n\n{shown}"
        insert(PAGE, "rivals", text)


if __name__ == "__main__":
    main()
