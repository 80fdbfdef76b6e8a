"""The node of ROS 2: the same bits as Python, and the round trip with a node written in Rust.

uv run python benchmarks/ros2 --bits 60
uv run python benchmarks/ros2 --round-trip 600 --silences 20 --kills 20
"""

import argparse
import json
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from ros2 import live, lockstep
from tautscope.config import load_config

SEED = 20


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    for name, text in (
        ("bits", "seconds of the same input for node and Python; 60"),
        ("round-trip", "seconds of references at 200 Hz and images at 25 Hz; 600"),
        ("silences", "times that the device falls silent; 20"),
        ("kills", "times that the node is killed; 20"),
    ):
        parser.add_argument(f"--{name}", type=int, default=0, metavar="N", help=text)
    return parser.parse_args()


def say(what: str, found: object) -> None:
    print(json.dumps({"what": what, "found": found}), flush=True)


def main() -> None:
    options = arguments()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for profile in ("best", "paper") if options.bits else ():
            place = folder / profile
            place.mkdir()
            config = load_config(None, profile)
            found = lockstep.compare(config, place, options.bits, SEED, [(20.0, 0.5), (30.0, 1.0)])
            say(
                f"bits, {profile}",
                {
                    "commands": found.ticks,
                    "different": found.different,
                    "images": found.images,
                    "updates": found.updates,
                    "missed": found.missed,
                    "travel": found.travel.tolist(),
                },
            )
        if not (options.round_trip or options.silences or options.kills):
            return
        live.build_peer(lambda text: print(text, file=sys.stderr))
        with live.lab(folder) as laboratory:
            laboratory.start()
            if options.round_trip:
                say("round trip", live.round_trip(laboratory, options.round_trip))
            if options.silences:
                say("silent device [s]", sorted(live.silences(laboratory, options.silences)))
            status, log = laboratory.end(), laboratory.log
            say("exit status after SIGTERM", status)
            say("time between ticks [s]", live.intervals(log))
            if options.kills:
                laboratory.start()
                say("killed node [s]", sorted(live.kills(laboratory, options.kills)))


if __name__ == "__main__":
    main()
