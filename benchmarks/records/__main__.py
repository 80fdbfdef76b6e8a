"""Prediction of the tip on records, by the weighted mixture and all other models of `analyze`.

Records of real tools (TAUTSCOPE_DATA), and synthetic families; the loop's own filter by itself on
the records of real tools and of a real continuum robot (`--only loop`). Of the verdict: whether it
is right on simulated records of known truth (`--only honest`); what it says of real ones (`--only
verdicts`), with figures to look at (`--figures`); its compensator on the other half of its record
(`--only compensator`); the time that the episodes of a data set take (`--only episodes`). `--write`
updates docs/models.md and docs/verdicts.md.
"""

import argparse
import json
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from common.doc_pages import insert
from common.paths import ROOT
from common.processes import add_arguments, run_parallel
from common.rows import goal_row, outcome_rows
from records import compensator, honest, lerobot, loop, verdicts
from records.evaluation import Job, Result, evaluate
from records.families import FAMILIES
from records.tools import SPLICED, tools
from tautscope.analysis.comparison import HORIZONS

FIRST_SEED, SEEDS = 100, 5
"""The settings of the mixture were chosen on seeds 0 to 5."""
GOAL, STROKES_GOAL, WORSE_GOAL = 1.05, 2, 2
"""Largest ratio to the best other model, strokes to follow a change, and strokes worse than the
trivial predictors."""

OF_VERDICTS = ("honest", "verdicts", "compensator")
"""Tables of docs/verdicts.md."""

Results = dict[str, list[list[Result]]]
"""By name: per seed, per horizon."""


def to_rows(results: Results) -> list[dict[str, Any]]:
    """Rows per record or family and horizon."""
    return [row for name, found in results.items() for row in _rows(name, found)]


def _rows(name: str, found: list[list[Result]]) -> Iterator[dict[str, Any]]:
    for at, share in enumerate(HORIZONS):
        each = [result[at] for result in found]
        quantities: list[tuple[str, str, list[float], float]] = [
            ("best", "ratio to the best other model", [r.ratio for r in each], GOAL),
            ("best", "ratio to the best other predictor", [r.predicting for r in each], GOAL),
            ("best", "strokes worse than trivial", [r.worse_strokes for r in each], WORSE_GOAL),
        ]
        if name in SPLICED:
            for what, values in (
                ("strokes to follow", [r.strokes_to_follow or 0 for r in each]),
                ("strokes to settle", [r.strokes_to_settle or 0 for r in each]),
            ):
                quantities.append(("best", what, [float(v) for v in values], STROKES_GOAL))
        for profile, what, values, goal in quantities:
            row = goal_row(f"{name}, {share:.0%}: {what}", "1", values, goal, profile=profile)
            yield row | {"record": name, "horizon": share, "quantity": what}


def table(rows: Sequence[dict[str, Any]]) -> str:
    """Markdown: ratios per group of records or family, then a line per horizon over all."""

    def of(quantity: str, key: str, value: Any) -> list[dict[str, Any]]:
        return [row for row in rows if row["quantity"] == quantity and row[key] == value]

    shares = " | ".join(f"{100 * share:.0f} %" for share in HORIZONS)
    lines = [f"| record or family | {shares} |", f"|---|{'--:|' * len(HORIZONS)}"]
    groups: dict[str, list[str]] = {}
    for name in dict.fromkeys(row["record"] for row in rows):
        groups.setdefault(loop.group(name), []).append(name)
    for title, names in groups.items():
        ratios = [of("ratio to the best other model", "record", name) for name in names]
        cells = [
            f"{np.median([row['median'] for row in each]):.2f}"
            + (
                f" ({max(row['worst'] for row in each):.2f})"
                if len(each) * each[0]["n"] > 1
                else ""
            )
            for each in zip(*ratios, strict=True)
        ]
        number = f", {len(names)}" if len(names) > 1 else ""
        lines.append(f"| {title}{number} | {' | '.join(cells)} |")
    for share in HORIZONS:
        own = of("ratio to the best other model", "horizon", share)
        held = sum(row["holds"] for row in own)
        ratios = [row["median"] for row in own]
        most = (
            f"{what} at most {max(row['worst'] for row in of(what, 'horizon', share)):.0f}"
            for what in ("strokes worse than trivial", "strokes to follow", "strokes to settle")
            if of(what, "horizon", share)
        )
        lines += [
            "",
            f"At {100 * share:.0f} %: {held} of {len(own)} records and families hold {GOAL}; "
            f"median {np.median(ratios):.2f}, worst {max(ratios):.2f}, worst seed "
            f"{max(row['worst'] for row in own):.2f}; {', '.join(most)}.",
        ]
    return "\n".join(lines)


def measure(options: argparse.Namespace, seeds: Sequence[int]) -> Results:
    """Evaluate the models of `analyze` on the records and families."""
    jobs: list[Job] = []
    if options.only != "families":
        if not tools():
            print("No records of tools: TAUTSCOPE_DATA has no davinci_tools.", file=sys.stderr)
        else:
            jobs += [(name, 0) for name in [*tools(), *SPLICED]]
    if options.only != "tools":
        jobs += [(family, seed) for family in FAMILIES for seed in seeds]
    done = dict(run_parallel(evaluate, jobs, options.workers, options.scheduler))
    results: Results = {}
    for job in jobs:
        results.setdefault(job[0], []).append(done[job])
    return results


def measure_filter(options: argparse.Namespace) -> dict[str, loop.Errors]:
    """Evaluate the loop's filter on all real records."""
    names = loop.records()
    if not names:
        print("No real records in TAUTSCOPE_DATA.", file=sys.stderr)
    done: dict[str, loop.Errors] = {}
    for name, errors in run_parallel(loop.evaluate, names, options.workers, options.scheduler):
        done[name] = errors
        print(f"{len(done)} of {len(names)}: {name}", file=sys.stderr)
    return {name: done[name] for name in names}


def measure_compensators(options: argparse.Namespace) -> dict[str, list[compensator.Reduction]]:
    """Evaluate the compensators of all real records whose slack is identified."""
    names = [name for name in loop.records() if name not in SPLICED]
    done = dict(run_parallel(compensator.evaluate, names, options.workers, options.scheduler))
    return {name: done[name] for name in names}


def judge_all(options: argparse.Namespace) -> list[tuple[str, str, Mapping[Any, Any]]]:
    """The tables of docs/verdicts.md that are asked for: name, text, and outcomes by job."""
    parts: list[tuple[str, str, Mapping[Any, Any]]] = []
    if options.only in (None, "honest"):
        jobs = honest.jobs()
        outcomes = dict(run_parallel(honest.evaluate, jobs, options.workers, options.scheduler))
        outcomes = {job: outcomes[job] for job in jobs}
        parts.append(("honest", honest.table(outcomes), outcomes))
    if options.only in (None, "verdicts"):
        real = [(name, options.figures) for name in verdicts.names()]
        answers = dict(run_parallel(verdicts.evaluate, real, options.workers, options.scheduler))
        by_name = {job[0]: answers[job] for job in real}
        parts.append(("verdicts", verdicts.table(by_name), by_name))
        for name, _ in real if options.figures else ():
            text = answers[name, options.figures].text
            (options.figures / f"{name}.txt").write_text(f"{text}\n", encoding="utf-8")
    if options.only in (None, "compensator"):
        reductions = measure_compensators(options)
        parts.append(("compensator", compensator.table(reductions), reductions))
    return parts


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=SEEDS, help="per family [%(default)s]")
    parser.add_argument("--first-seed", type=int, default=FIRST_SEED, help="[%(default)s]")
    parser.add_argument(
        "--only",
        choices=["tools", "families", "loop", *OF_VERDICTS, "episodes"],
        help="[all but episodes]",
    )
    parser.add_argument(
        "--baseline",
        type=Path,
        metavar="FILE",
        help="output of --only loop --json with another state, to compare the filter with",
    )
    parser.add_argument(
        "--figures", type=Path, metavar="FOLDER", help="figures and verdicts of the real records"
    )
    add_arguments(parser)
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    parser.add_argument("--write", action="store_true", help="update the pages")
    options = parser.parse_args()
    is_whole = options.only in (None, "loop", *OF_VERDICTS)
    if options.write and not (is_whole and (tools() or options.only == "honest")):
        parser.error(
            "--write updates whole tables: use it with TAUTSCOPE_DATA, and without --only or with "
            f"--only loop, {', '.join(OF_VERDICTS)}"
        )
    if options.json and options.only == "episodes":
        parser.error("--json has no rows for --only episodes")
    if options.figures is not None:
        options.figures.mkdir(parents=True, exist_ok=True)
    return options


def main() -> None:
    options = arguments()
    if options.only == "episodes":
        print(lerobot.measure())
        return
    seeds = range(options.first_seed, options.first_seed + options.seeds)
    rows: list[dict[str, Any]] = []
    parts: list[tuple[str, str]] = []
    facts: dict[str, Any] = {"seeds": list(seeds)}
    if options.only not in ("loop", *OF_VERDICTS):
        rows = to_rows(measure(options, seeds))
        conditions = f"Families: seeds {seeds[0]} to {seeds[-1]}, median (worst)."
        parts.append(("records", f"{conditions}\n\n{table(rows)}"))
    if options.only in (None, "loop"):
        errors = measure_filter(options)
        baseline = None
        if options.baseline is not None:
            baseline = json.loads(options.baseline.read_text(encoding="utf-8"))["errors"]
        of_filter = loop.to_rows(errors, baseline)
        rows += of_filter
        parts.append(("loop", loop.table(errors, of_filter)))
        facts["errors"] = errors
    judged = judge_all(options)
    of_verdicts = [(name, text) for name, text, _ in judged]
    if judged:
        facts["outcomes"] = {name: outcome_rows(found) for name, _, found in judged}
    if options.json:
        print(json.dumps({"rows": rows, **facts}, default=asdict))
    else:
        print("\n\n".join(text for _, text in parts + of_verdicts))
    for page, tables in (("models.md", parts), ("verdicts.md", of_verdicts)):
        for name, text in tables if options.write else ():
            insert(ROOT / "docs" / page, name, text)


if __name__ == "__main__":
    main()
