"""`tautscope analyze` of damaged files: it may refuse them with a message, and nothing else.

Of the files some have columns that are no record, some are damaged, some are both. Each is listed,
and the first pair of its columns judged; every 50th one is analysed in full, by the command. Exit
status 1 after a traceback, or if a file takes more than 10 s of processor time, in full 30 s.
"""

import argparse
import os
import sys
from collections import Counter
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from damage.trial import KINDS, run


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--files", type=int, default=2000, help="[%(default)s]")
    parser.add_argument("--seed", type=int, default=0, help="[%(default)s]")
    parser.add_argument("--cases", type=Path, help="folder of folders with more tables")
    options = parser.parse_args()
    os.environ["MPLBACKEND"] = "agg"
    found = run(options.files, options.seed, options.cases)
    print(f"| file | {' | '.join(KINDS)} |\n|---|{'--:|' * len(KINDS)}")
    for name, counts in {**found, "all": sum(found.values(), Counter())}.items():
        print(f"| {name} | {' | '.join(str(counts[kind]) for kind in KINDS)} |")
    if any(counts["FAILED"] for counts in found.values()):
        raise SystemExit(1)


if __name__ == "__main__":
    main()
