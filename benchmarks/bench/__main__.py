"""The bench: from doctor to the article's experiment in two processes, and failures.

One process is the rig (`tautscope bench`), another one controls it (`tautscope run`), over a bus
and a camera stream, at 100 Hz in real time.

- The first part does what a user does: `doctor`, `calibrate stops` of servos, `calibrate geometry`,
  and the protocol with and without compensation. It compares the reductions with those of the
  in-process twin of the same seed, profile and control period. Both second runs continue with the
  instrument of the first. The bench saves the true tip for this evaluation only. Both logs are
  replayed. ``--minutes`` is the duration of each run, filled with periods; a minute of log takes
  1 GB.
- The second part injects faults of the camera, the third one uses wrong configurations, each in its
  own run (of ``--config bench``).
- The last part takes the configuration of each owner in docs/hardware.md to the first compensated
  motion, on a rig whose camera, pose, lengths and delay differ from it.
"""

import argparse
import json
import os
import sys
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from bench.commissioning import owners
from bench.comparison import compare
from bench.failures import run_faults, run_wrong
from bench.tables import tables
from tautscope.config import load_config
from tautscope.dof import Dof


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--minutes", type=float, help="duration of each run [that of the periods]")
    parser.add_argument("--config", default="bench", help="bench, bench_dynamixel, ... [bench]")
    parser.add_argument("--period", type=float, help="of the sines [s] [that of the configuration]")
    parser.add_argument("--periods", type=int, default=5, help="per degree of freedom")
    parser.add_argument("--profile", default="best")
    parser.add_argument("--heartbeat-timeout", type=float, help="[s] [that of the configuration]")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path, help="folder for the run, and for bench.json")
    parser.add_argument("--only", choices=["compared", "faults", "wrong", "owners"])
    parser.add_argument("--owner", help="word in the configuration of the only owner")
    arguments = parser.parse_args()
    if arguments.minutes is not None:
        experiment = load_config(arguments.config).experiment
        seconds = sum(arguments.period or experiment[dof].period for dof in Dof)
        arguments.periods = round(60 * arguments.minutes / seconds)
    document: dict[str, Any] = {"cpus": os.cpu_count(), "load": os.getloadavg()}
    if arguments.only in {None, "compared"}:
        document |= compare(arguments, arguments.out)
    has_faults = arguments.config == "bench"
    if arguments.only in {None, "faults"} and has_faults:
        document["faults"] = run_faults(arguments)
    if arguments.only in {None, "wrong"} and has_faults:
        document["wrong"] = run_wrong(arguments)
    if arguments.only in {None, "owners"}:
        document["owners"] = owners(arguments.owner, arguments.heartbeat_timeout)
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
