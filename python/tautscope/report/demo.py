"""The article's experiment, end to end: runs, Table 1, figures, run folder."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from os import PathLike

from tautscope.config import Config
from tautscope.report import tables
from tautscope.report.results import Results, evaluate
from tautscope.runs.output_folder import new_folder
from tautscope.runs.recording import Recording
from tautscope.runs.trials import RigMaker, Trial, make_twin, run_trials


@dataclass(frozen=True)
class Demo:
    """What ``tautscope demo`` found.

    Attributes:
        config: As used for the first seed.
        seeds: One per result.
        results: Table 1 of each seed.
        uncompensated: The first seed's run without compensation.
        compensated: The first seed's run with it.
        sim_seconds: Simulated time of all runs.
        wall_seconds: How long they took.
        article_results: Table 1 of each seed under profile ``paper``, when `config` has another.
    """

    config: Config
    seeds: tuple[int, ...]
    results: tuple[Results, ...]
    uncompensated: Recording
    compensated: Recording
    sim_seconds: float
    wall_seconds: float
    article_results: tuple[Results, ...] = ()

    @property
    def by_profile(self) -> dict[str, tuple[Results, ...]]:
        """Table 1 of each seed under each profile that was run, the configuration's own last."""
        article = {"paper": self.article_results} if self.article_results else {}
        return {**article, self.config.profile: self.results}


def run_demo(
    config: Config,
    seeds: Sequence[int],
    progress: Callable[[float], None],
    make_rig: RigMaker = make_twin,
) -> Demo:
    """The article's protocol with and without compensation, once per seed.

    With another profile than ``paper``, once more as the article compensates.

    Raises:
        TautscopeError: What a run raised.
    """
    begun = time.perf_counter()
    configs = [config.replace(**{"twin.seed": seed}) for seed in seeds]
    kinds = [Trial(configs[0], False), Trial(configs[0], True)]
    if config.profile != "paper":
        kinds.append(Trial(config.replace(profile="paper"), True))
    trials = [
        Trial(kind.config.replace(**{"twin.seed": each.twin.seed}), kind.compensate)
        for each in configs
        for kind in kinds
    ]
    recordings = run_trials(trials, progress, make_rig)
    runs = [recordings[first :: len(kinds)] for first in range(len(kinds))]
    results = [tuple(map(evaluate, runs[0], compensated)) for compensated in runs[1:]]
    return Demo(
        config=configs[0],
        seeds=tuple(seeds),
        results=results[0],
        uncompensated=runs[0][0],
        compensated=runs[1][0],
        sim_seconds=sum(float(run.trace["time"][-1] - run.trace["time"][0]) for run in recordings),
        wall_seconds=time.perf_counter() - begun,
        article_results=results[1] if len(results) > 1 else (),
    )


def write_run_folder(demo: Demo, folder: str | PathLike[str]) -> None:
    """Make the run folder with everything a person or a program wants later, or nothing.

    config.toml, table1.csv, trace.csv and frames.csv (first seed, compensated), the same with
    _uncompensated, fig9.png, fig9.pdf, fig5.png, report.html.

    Raises:
        OutputError: The folder holds something already, or cannot be written.
    """
    from tautscope.report import figures, report  # noqa: PLC0415  matplotlib takes half a second

    figure9 = figures.figure9(demo.uncompensated, demo.compensated)
    pictures = [
        report.Picture(
            figure9,
            f"Fig. 9, seed {demo.seeds[0]}. (a)-(c) with compensation, each degree of freedom "
            "while it moves: reference, command, estimate and both contact offsets. (d)-(f) loops: "
            "the estimate over the command without, over the reference with compensation; the "
            "first period, in which the slack is learnt, is thin. The dashed line is a perfect "
            "tip.",
        )
    ]
    if demo.compensated.snapshot is not None:
        pictures.append(
            report.Picture(
                figures.figure5(demo.compensated.snapshot, demo.config),
                "Fig. 5. One frame of the compensated run: as the camera gave it, the pixels above "
                "the discriminant's threshold, the regions with markers A and B, and measured "
                "beside predicted features.",
            )
        )
    with new_folder(folder) as place:
        demo.compensated.write(place)
        demo.uncompensated.write(place, "_uncompensated")
        tables.write_csv(place / "table1.csv", demo.seeds, demo.by_profile)
        with figures.style():
            figure9.savefig(place / "fig9.png")
            figure9.savefig(place / "fig9.pdf", metadata={"CreationDate": None})
            for picture in pictures[1:]:
                picture.figure.savefig(place / "fig5.png")
            page = report.demo_report(demo, pictures)
        (place / "report.html").write_text(page, encoding="utf-8")
