"""The article's experiment in two processes, compared with the in-process twin; and failures.

One process is the rig (`tautscope bench`), another one controls it (`tautscope run`), over a CAN
bus and a camera stream, at 100 Hz in real time.

- The first part runs the protocol with and without compensation, and compares the reductions with
  those of the in-process twin of the same seed, profile and control period. Both second runs
  continue with the instrument of the first. The bench saves the true tip for this evaluation only.
  Both logs are replayed. ``--minutes`` is the duration of each run, filled with periods; a minute
  of log takes 1 GB.
- The second part injects faults, the third one uses wrong configurations, each in its own run.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from bench.comparison import compare
from bench.failures import run_faults, run_wrong
from bench.tables import tables
from tautscope.dof import Dof


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--minutes", type=float, help="duration of each run [that of the periods]")
    parser.add_argument("--period", type=float, default=10.0, help="period of the sines [s]")
    parser.add_argument("--periods", type=int, default=5, help="per degree of freedom")
    parser.add_argument("--profile", default="paper")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path, help="folder for the run, and for bench.json")
    parser.add_argument("--only", choices=["compared", "faults", "wrong"])
    arguments = parser.parse_args()
    if arguments.minutes is not None:
        arguments.periods = round(60 * arguments.minutes / (len(Dof) * arguments.period))
    document: dict[str, Any] = {"cpus": os.cpu_count(), "load": os.getloadavg()}
    if arguments.only in {None, "compared"}:
        document |= compare(arguments, arguments.out)
    if arguments.only in {None, "faults"}:
        document["faults"] = run_faults(arguments)
    if arguments.only in {None, "wrong"}:
        document["wrong"] = run_wrong(arguments)
    if arguments.out is not None:
        arguments.out.mkdir(parents=True, exist_ok=True)
        file = arguments.out / "bench.json"
        file.write_text(json.dumps(document, indent=1), encoding="utf-8")
    if arguments.json:
        print(json.dumps(document, indent=1))
        return
    for line in tables(document):
        print(line)


if __name__ == "__main__":
    main()
