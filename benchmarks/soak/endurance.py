"""Ten hours of the loop, all made anew after each hour: what grows, and what is lost.

Ideal plays and an operator's motion that is the same in every session; a session makes rig, loop
and log anew, in the same process. `--write` updates docs/soak.md.
"""

import argparse
import json
import os
import sys
import tempfile
import threading
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from time import perf_counter

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np
from common.doc_pages import insert
from common.features import update_from_features
from common.paths import ROOT
from numpy.typing import ArrayLike
from plants.simulated import PlantRig
from soak.references import make_reference
from tautscope.commands.printing import progress_bar
from tautscope.config import Config, load_config
from tautscope.dof import Dof
from tautscope.log.writer import LogWriter
from tautscope.loop.rig import Sample
from tautscope.runs.control_loop import ControlLoop

SESSIONS, SECONDS, SEED = 10, 3600.0, 720
STROKE = 1.0
"""Longest stroke over the width of the slack."""
IMAGE = np.zeros((16, 16, 3), np.uint8)
"""Small, because the loop takes the features; the log encodes and writes it."""
PAGE = ROOT / "docs" / "soak.md"


@dataclass(frozen=True, slots=True)
class Session:
    """Figures of a session.

    Attributes:
        error: RMS of (true tip - reference) per DOF [m, rad, rad].
        tick: Median of a tick with its image update and log, without the rig [s].
        memory: Resident memory of the process at the end, after everything was closed [bytes].
        descriptors: Open files then.
        threads: Threads then.
        ticks: Of the loop.
        in_log: Ticks in the log.
        size: Of the log [bytes].
    """

    error: list[float]
    tick: float
    memory: int
    descriptors: int
    threads: int
    ticks: int
    in_log: int
    size: int


class ImageRig(PlantRig):
    """A `PlantRig` whose frames have an image, for the log."""

    def step(self, command: ArrayLike) -> Sample:
        """Move, and let one control period pass."""
        sample = super().step(command)
        if sample.frame is None:
            return sample
        return replace(sample, frame=replace(sample.frame, image=IMAGE))


def run_session(config: Config, seconds: float, folder: Path) -> Session:
    """Run from the start of a log to its end."""
    reference = make_reference(config, "hand", STROKE, config.twin.seed, seconds)
    squares, durations = np.zeros(3), []
    rig = ImageRig(config, "independent plays")
    with LogWriter(folder / "run.mcap", config, wait=True) as log:
        ticks = ControlLoop(config, rig, look=update_from_features)
        ticks.write_to(log)
        while ticks.sample.time < seconds:
            desired = reference(ticks.sample.time)
            began = perf_counter()
            ticks.control(desired)
            for _ in ticks.updates():
                pass
            durations.append(perf_counter() - began)
            assert ticks.sample.true_state is not None
            squares += (ticks.sample.true_state - desired) ** 2
            ticks.step()
        ticks.write_events()
    summary = log.close()
    rig.close()
    path = summary.path
    size = path.stat().st_size
    path.unlink()
    return Session(
        error=np.sqrt(squares / len(durations)).tolist(),
        tick=float(np.median(durations)),
        memory=_resident(),
        descriptors=len(list(Path("/proc/self/fd").iterdir())),
        threads=threading.active_count(),
        ticks=len(durations),
        in_log=summary.ticks - summary.dropped,
        size=size,
    )


def _resident() -> int:
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE")


def table(sessions: list[Session]) -> str:
    """Return a Markdown table: the first two sessions, the last, and the worst value of all."""
    labels = " | ".join(f"{dof.label} [{dof.display_unit}]" for dof in Dof)
    lines = [
        f"| session | {labels} | tick [us] | memory [MB] | files | threads | ticks lost |",
        "|--:|" + "--:|" * 8,
    ]
    rows = [
        (
            *(dof.display_scale * each.error[dof] for dof in Dof),
            1e6 * each.tick,
            each.memory / 1e6,
            each.descriptors,
            each.threads,
            each.ticks - each.in_log,
        )
        for each in sessions
    ]
    shown = {str(number): row for number, row in enumerate(rows, 1)}
    for number in range(3, len(rows)):
        del shown[str(number)]
    shown["worst of all"] = tuple(map(max, zip(*rows, strict=True)))
    formats = [".3f"] * 3 + [".0f", ".1f", "d", "d", "d"]
    for name, row in shown.items():
        cells = (f"{value:{form}}" for value, form in zip(row, formats, strict=True))
        lines.append(f"| {name} | {' | '.join(cells)} |")
    total = sum(each.size for each in sessions)
    ticks = sum(each.ticks for each in sessions)
    return "\n".join([*lines, "", f"{ticks:,} ticks, {total / 1e9:.2f} GB of logs."])


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--sessions", type=int, default=SESSIONS, help="[%(default)s]")
    parser.add_argument("--seconds", type=float, default=SECONDS, help="of each [%(default)s]")
    parser.add_argument("--seed", type=int, default=SEED, help="[%(default)s]")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    parser.add_argument("--write", action="store_true", help=f"update {PAGE.relative_to(ROOT)}")
    options = parser.parse_args()
    config = load_config().replace(**{"twin.seed": options.seed})
    sessions = []
    with tempfile.TemporaryDirectory() as folder, progress_bar("endurance") as show_progress:
        for number in range(options.sessions):
            sessions.append(run_session(config, options.seconds, Path(folder)))
            show_progress((number + 1) / options.sessions)
    shown = table(sessions)
    print(json.dumps({"sessions": [asdict(each) for each in sessions]}) if options.json else shown)
    if options.write:
        text = f"Seed {options.seed}, sessions of {options.seconds:g} s.\n\n{shown}"
        insert(PAGE, "endurance", text)


if __name__ == "__main__":
    main()
