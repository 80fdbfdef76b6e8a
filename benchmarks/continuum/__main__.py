"""Prediction of the tip of a real tendon-driven continuum robot, with and without memory.

The robot has three segments and nine tendons (TAUTSCOPE_DATA). Its static model is fitted on the
first two thirds of the record; regressions and filters also learn in the last third from what they
have seen. `--write` updates docs/plants.md.
"""

import argparse
import json
import sys
from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from common.doc_pages import insert
from common.paths import ROOT
from common.processes import add_arguments, run_parallel
from continuum.prediction import MODELS, Case, Prediction, predict_case
from continuum.robot import FILE, Floats, Record, Robot, fit, read

DELAYS = (1, 5, 20)
"""Rows since the tip was seen."""
NEAR, MOVES, APART = 0.5, 0.2, 60
"""Of the same pull on the way out and back: largest difference and least motion [mm], rows."""


def split(record: Record) -> int:
    """First row of the last third."""
    return 2 * len(record) // 3


def static_model(record: Record) -> Robot:
    """The robot fitted on all but the last third."""
    end = split(record)
    return fit(Record(record.servos[:end], record.tip[:end]))


def rms(error: Floats) -> float:
    """RMS length of errors (n, 3) in mm."""
    return float(1e3 * np.sqrt(np.mean(np.sum(error**2, axis=1))))


def out_and_back(pulls: Floats, begin: int) -> list[tuple[int, int]]:
    """Pairs of rows with equal pulls (n, 9) that move in opposite directions, within a motion."""
    speed = np.gradient(pulls, axis=0)
    pace = np.linalg.norm(speed, axis=1)
    return [
        (row, other)
        for row in range(begin, len(pulls))
        for other in range(max(begin, row - APART), row)
        if min(pace[row], pace[other]) > MOVES
        and np.linalg.norm(pulls[row] - pulls[other]) < NEAR
        and speed[row] @ speed[other] < -0.5 * pace[row] * pace[other]
    ]


def to_rows(record: Record, robot: Robot, found: Mapping[Case, Prediction]) -> list[dict[str, Any]]:
    """A row per model: RMS errors over the last third [mm] by rows since the tip was seen."""
    begin = split(record)
    tip = robot.to_base(record.tip)
    rows = []
    for model in dict.fromkeys(model for model, _ in found):
        own = {delay: each for (name, delay), each in found.items() if name == model}
        errors = {delay: rms((each.tip - tip)[begin:]) for delay, each in own.items()}
        refused = sum(each.refused for each in own.values())
        rows.append({"model": model, "rms_mm": errors, "refused": refused})
    return rows


def facts(record: Record, robot: Robot) -> dict[str, float]:
    """Error of the static model, and how far the tip is apart on the way out and back [mm]."""
    begin, tip = split(record), robot.to_base(record.tip)
    error = tip - robot.tip(record.servos)
    first, second = np.transpose(out_and_back(robot.taut(record.servos), begin))
    return {
        "static_fitted": rms(error[:begin]),
        "static_last_third": rms(error[begin:]),
        "out_and_back": rms(error[first] - error[second]),
        "pairs": len(first),
    }


def table(rows: list[dict[str, Any]], known: Mapping[str, float]) -> str:
    """Markdown: errors, what plays add, and the facts."""
    lines = [
        f"| tip last seen: rows ago | {' | '.join(map(str, DELAYS))} |",
        f"|---|{'--:|' * len(DELAYS)}",
    ]
    for row in rows:
        cells = (f"{row['rms_mm'][delay]:.1f}" for delay in DELAYS)
        lines.append(f"| {row['model']} | {' | '.join(cells)} |")
    lines.append("")
    for without, with_plays in pairwise(rows):
        if without["model"] == f"{with_plays['model']} without plays":
            more = (with_plays["rms_mm"][k] / without["rms_mm"][k] - 1 for k in DELAYS)
            shares = ", ".join(f"{share:+.0%}" for share in more)
            lines.append(f"Plays change the error by {shares} ({with_plays['model']}).")
    lines += [
        f"The static model by itself is off by {known['static_fitted']:.1f} mm where it was "
        f"fitted, and by {known['static_last_third']:.1f} mm in the last third.",
        f"With equal pulls on the way out and back the tip is {known['out_and_back']:.1f} mm apart "
        f"({known['pairs']:.0f} pairs of rows, less what the static model explains).",
    ]
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(prog="continuum", description=__doc__.splitlines()[0])
    add_arguments(parser)
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    parser.add_argument("--write", action="store_true", help="update docs/plants.md")
    options = parser.parse_args()
    if not FILE.exists():
        parser.error(f"File not found: {FILE}. Set TAUTSCOPE_DATA to the folder of real data.")
    record = read()
    robot = static_model(record)
    cases = [(model, delay) for model in MODELS for delay in DELAYS]
    # Those that take longest first.
    jobs = [(robot, record, each) for each in reversed(cases)]
    done = run_parallel(predict_case, jobs, options.workers, options.scheduler)
    results = {job[2]: result for job, result in done}
    found = {each: results[each] for each in cases}
    rows, known = to_rows(record, robot, found), facts(record, robot)
    text = table(rows, known)
    if options.write:
        insert(ROOT / "docs" / "plants.md", "continuum", text)
    print(json.dumps({"rows": rows, **known}) if options.json else text)


if __name__ == "__main__":
    main()
