"""A file that is tried, and many of them."""

import contextlib
import faulthandler
import io
import json
import shutil
import sys
import tempfile
import time
import traceback
import warnings
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from damage.files import damage, signals, wild, write_like, write_seeds
from tautscope.analysis.verdict import judge
from tautscope.cli import main as tautscope
from tautscope.errors import TautscopeError
from tautscope.runs.columns import time_column
from tautscope.runs.episodes import is_data_set, list_episodes, open_episode
from tautscope.runs.records import read_record
from tautscope.runs.tables import open_table

LONGEST, LONGEST_WHOLE = 10.0, 30.0
"""Processor time of a file, and of one that is analysed in full, with its figures [s]."""
WHOLE = 50
"""Of so many files one is analysed in full."""


KINDS = ("refused", "no pair", "judged", "analysed", "FAILED")


@dataclass(frozen=True)
class Outcome:
    """What became of a file.

    Attributes:
        what: One of `KINDS`.
        text: Message or traceback.
    """

    what: str
    text: str = ""


def try_file(file: Path, is_whole: bool) -> Outcome:
    """List a file and judge its first pair, or analyse it in full."""
    try:
        status, text = _command("analyze", file, "--json")
        if status == 2 and text.startswith("error: ") and "Traceback" not in text:
            return Outcome("refused", text)
        if status != 0:
            return Outcome("FAILED", f"exit status {status}: {text}")
        pairs = json.loads(text)["pairs"]
        if not pairs:
            return Outcome("no pair")
        return _judged(file, pairs[0], is_whole)
    except Exception:
        return Outcome("FAILED", traceback.format_exc())


def _judged(file: Path, pair: dict[str, str], is_whole: bool) -> Outcome:
    if is_whole:
        columns = ["--command", pair["command"], "--measured", pair["measured"]]
        with tempfile.TemporaryDirectory() as place:
            status, text = _command("analyze", file, *columns, "--out", f"{place}/out")
        if status not in (0, 2):
            return Outcome("FAILED", f"exit status {status}: {text}")
        return Outcome("analysed" if status == 0 else "refused", text)
    try:
        if is_data_set(file):
            sheet = open_episode(file, list_episodes(file)[0])
        else:
            sheet = open_table(file)
        record = read_record(sheet, pair["command"], pair["measured"], time_column(sheet.titles))
        judge(record).to_json()
    except TautscopeError as error:
        return Outcome("refused", str(error))
    return Outcome("judged")


def _command(*words: object) -> tuple[int, str]:
    """Exit status of a command, and its output with stderr."""
    output = io.StringIO()
    with contextlib.redirect_stdout(output), contextlib.redirect_stderr(output):
        status = tautscope([str(word) for word in words])
    return int(status or 0), output.getvalue()


def run(count: int, seed: int, cases: Path | None, whole: int = WHOLE) -> dict[str, Counter[str]]:
    """Damage and try files; outcomes by seed file, failures on stderr."""
    found: dict[str, Counter[str]] = {}
    with tempfile.TemporaryDirectory() as place:
        seeds = write_seeds(_folder(place, "seeds"), signals())
        seeds += sorted(cases.glob("*/in*.*")) if cases else []
        for number in range(count):
            rng = np.random.default_rng([4100, seed, number])
            origin = seeds[number % len(seeds)]
            folder = _folder(place, "damaged")
            if rng.random() < 0.7 and origin.parent == Path(place, "seeds"):
                with np.errstate(all="ignore"):
                    origin = write_like(origin, _folder(place, "wild"), wild(rng))
            file = origin if rng.random() < 0.4 else damage(origin, folder, rng)
            faulthandler.dump_traceback_later(200, exit=True)
            begin = time.process_time()
            with warnings.catch_warnings(record=True):
                outcome = try_file(file, is_whole=number % whole == whole - 1)
            faulthandler.cancel_dump_traceback_later()
            taken = time.process_time() - begin
            if taken > (LONGEST_WHOLE if outcome.what == "analysed" else LONGEST):
                outcome = Outcome("FAILED", f"{taken:.0f} s, then {outcome.what}: {outcome.text}")
            if outcome.what == "FAILED":
                print(f"{number}, {origin.name}: {outcome.text}", file=sys.stderr, flush=True)
            found.setdefault(origin.name, Counter())[outcome.what] += 1
            for name in ("damaged", "wild"):
                shutil.rmtree(Path(place, name), ignore_errors=True)
    return found


def _folder(place: str, name: str) -> Path:
    folder = Path(place, name)
    folder.mkdir()
    return folder
