"""The article's experiment and an operator motion on the twin: runs, figures, folder, report."""

from __future__ import annotations

import platform
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from html import escape
from os import PathLike
from typing import TYPE_CHECKING, Any

from tautscope._core import __version__
from tautscope.config import Config
from tautscope.extras import installed_version
from tautscope.report import report, tables
from tautscope.report.operator_motion import (
    OPERATOR_ROWS,
    OperatorResults,
    evaluate_operator_motion,
    operator_motion,
)
from tautscope.report.results import ROWS, Results, combine, evaluate
from tautscope.runs.output_folder import new_folder
from tautscope.runs.recording import Recording
from tautscope.runs.trials import RigMaker, Trial, make_twin, run_trials

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_CAVEATS = """
<ul class="note">
<li>Everything here is simulated. The plant is a rigid-body model with friction and elasticity, not
an instrument; the figures say how the method works on that plant. This is research software, not a
medical device.</li>
<li>The article measured its figures on its own rig, with the camera. The widths of the twin are of
its true tip; compare the article with the rows &ldquo;by camera&rdquo;.</li>
<li>The article does not give the instrument&rsquo;s geometry, the camera&rsquo;s pose, the
reference amplitudes and the estimator&rsquo;s parameters; the configuration below has the values
used. The twin&rsquo;s friction is chosen such that the uncompensated widths resemble the
article&rsquo;s, so only the compensated rows are a result.</li>
<li>With gap-crossing gain K and exactly known width, the reduction is 1 &minus; 1/K: 80&nbsp;% for
K = 5. A width estimated too large gives more, one too small less. This holds for profile
&ldquo;paper&rdquo;; in &ldquo;best&rdquo; the command continues in contact until the whole offset
is compensated.</li>
</ul>
"""

_PROFILES = {
    "paper": "&ldquo;Paper&rdquo; is the article&rsquo;s scheme on the twin.",
    "best": "&ldquo;Best&rdquo; is this project&rsquo;s own scheme on the same twin.",
}
_OPERATOR_CAPTION = (
    "Operator motion, seed {}. (a)-(c) reference, command with compensation, and true tip without "
    "and with it, in 20 s of the run. (d)-(f) tracking error of the true tip; the grey part is "
    "not evaluated, because the offsets are still being estimated."
)
_FILM_CAPTION = (
    "The same motion of an operator without and with compensation, in the twin's camera. The rings "
    "are where the reference wants the two bands."
)


@dataclass(frozen=True)
class Demo:
    """Results of ``tautscope demo``; recordings are those of the first seed.

    Attributes:
        config: Configuration of the first seed.
        seeds: The seed of each result.
        by_profile: Table 1 of each seed by profile; the configuration's own profile is the last.
        article: `compensated` with profile ``paper``, if the configuration has another one.
        operator_results: The figures of the operator motion of each seed.
        sim_seconds: Simulated time of all runs [s].
        wall_seconds: Computing time [s].
    """

    config: Config
    seeds: tuple[int, ...]
    by_profile: dict[str, tuple[Results, ...]]
    uncompensated: Recording
    compensated: Recording
    article: Recording | None
    operator_results: tuple[OperatorResults, ...]
    operator_uncompensated: Recording
    operator_compensated: Recording
    sim_seconds: float
    wall_seconds: float

    @property
    def results(self) -> tuple[Results, ...]:
        """Table 1 of each seed."""
        return self.by_profile[self.config.profile]

    @property
    def warnings(self) -> tuple[str, ...]:
        """Warnings of the first seed's compensated runs, those of the operator motion marked."""
        marked = (f"operator motion: {line}" for line in self.operator_compensated.warnings)
        return (*self.compensated.warnings, *marked)

    @property
    def verdict(self) -> tuple[str, str]:
        """A sentence on the slack that remains, and one on an operator's motion."""
        left = [
            f"{tables.median_text(results, ROWS, 'compensated')} with profile {name}"
            for name, results in self.by_profile.items()
        ]
        slack = tables.median_text(self.results, ROWS, "uncompensated")
        reduction = tables.median_text(self.operator_results, OPERATOR_ROWS, "reduction")
        return (
            f"Slow sines: of {slack} of slack there remain {', '.join(left)}.",
            f"An operator's motion of all at once: tracking error less by {reduction}.",
        )

    def to_json(self) -> dict[str, Any]:
        """The output of ``tautscope demo --json``; an unknown figure is None.

        Medians over the seeds, and under ``worst`` the worst values; insertion in mm. Under
        ``paper`` the results of the article's scheme, if it was run beside another one. Under
        ``hand`` the medians of the operator motion's figures, in m and rad.
        """
        *article, (profile, results) = self.by_profile.items()
        return {
            "profile": profile,
            "seeds": list(self.seeds),
            "dof": tables.summary(results),
            **{name: tables.summary(each) for name, each in article},
            "hand": tables.operator_to_json(combine(self.operator_results, "median")),
            "sim_seconds": self.sim_seconds,
            "wall_seconds": self.wall_seconds,
        }


def run_demo(
    config: Config,
    seeds: Sequence[int],
    progress: Callable[[float], None],
    make_rig: RigMaker = make_twin,
) -> Demo:
    """Run the article's protocol and an operator motion, each with and without compensation.

    For every seed. If the profile is not ``paper``, another run of the article's protocol uses it
    for comparison.

    Raises:
        TautscopeError: The first error of a run.
    """
    started = time.perf_counter()
    configs = [config.replace(**{"twin.seed": seed}) for seed in seeds]
    trials = [trial for each in configs for trial in demo_trials(each)]
    recordings = run_trials(trials, progress, make_rig)
    kinds = len(recordings) // len(configs)
    free, *runs, operator, operator_free = (recordings[first::kinds] for first in range(kinds))
    return Demo(
        config=configs[0],
        seeds=tuple(seeds),
        by_profile={
            str(compensated[0].config.profile): tuple(map(evaluate, free, compensated))
            for compensated in reversed(runs)
        },
        uncompensated=free[0],
        compensated=runs[0][0],
        article=runs[1][0] if len(runs) > 1 else None,
        operator_results=tuple(map(evaluate_operator_motion, operator_free, operator)),
        operator_uncompensated=operator_free[0],
        operator_compensated=operator[0],
        sim_seconds=sum(float(run.trace["time"][-1] - run.trace["time"][0]) for run in recordings),
        wall_seconds=time.perf_counter() - started,
    )


def demo_trials(config: Config) -> list[Trial]:
    """The runs of one seed, the longest first, so that parallel processes end together."""
    article = [config] if config.profile == "paper" else [config, config.replace(profile="paper")]
    motion = operator_motion(config)
    return [
        Trial(config, False),
        *(Trial(each, True) for each in article),
        Trial(config, True, motion),
        # Only the true tip of this run is evaluated.
        Trial(config, False, motion, images=False),
    ]


def write_run_folder(demo: Demo, folder: str | PathLike[str]) -> None:
    """Make the run folder, complete or not at all.

    Files: config.toml, table1.csv, trace.csv and frames.csv (first seed, compensated), the same
    with _uncompensated, fig9.png, fig9.pdf, fig5.png; of the operator motion
    operator_motion.csv, .png and .pdf, film.gif, and trace and frames with _operator_motion and
    _operator_motion_uncompensated; report.html.

    Raises:
        OutputError: The folder is not empty, or cannot be written.
    """
    # Matplotlib takes half a second to import.
    from tautscope.figure_style import style  # noqa: PLC0415
    from tautscope.report import figures  # noqa: PLC0415
    from tautscope.report.film import write_film  # noqa: PLC0415
    from tautscope.report.operator_figure import draw_operator_motion  # noqa: PLC0415

    figure9 = figures.figure9(demo.uncompensated, demo.compensated, demo.article)
    motion = draw_operator_motion(demo.operator_uncompensated, demo.operator_compensated)
    drawn = {
        "fig9": (figure9, _figure9_caption(demo)),
        "operator_motion": (motion, _OPERATOR_CAPTION.format(demo.seeds[0])),
    }
    if demo.compensated.snapshot is not None:
        figure5 = figures.figure5(demo.compensated.snapshot, demo.config)
        drawn["fig5"] = figure5, report.FIGURE5_CAPTION
    with new_folder(folder) as place:
        demo.operator_compensated.write(place, "_operator_motion")
        demo.operator_uncompensated.write(place, "_operator_motion_uncompensated")
        demo.compensated.write(place)
        demo.uncompensated.write(place, "_uncompensated")
        tables.write_csv(place / "table1.csv", demo.seeds, demo.by_profile)
        motions = {str(demo.config.profile): demo.operator_results}
        tables.write_csv(place / "operator_motion.csv", demo.seeds, motions)
        with style():
            for name, (figure, _) in drawn.items():
                figure.savefig(place / f"{name}.png")
                if name != "fig5":
                    figure.savefig(place / f"{name}.pdf", metadata={"CreationDate": None})
        film = place / "film.gif"
        write_film(film, demo.operator_uncompensated, demo.operator_compensated)
        page = demo_report(demo, drawn.values(), film.read_bytes())
        (place / "report.html").write_text(page, encoding="utf-8")


def _figure9_caption(demo: Demo) -> str:
    rows, loops = ("(a)-(c)", "(d)-(f)") if demo.article is None else ("(a)-(f)", "(g)-(i)")
    return (
        f"Fig. 9, seed {demo.seeds[0]}. {rows} with compensation, each degree of freedom while it "
        "moves: reference, command, estimate, true tip and both contact offsets. The command moves "
        "ahead of the reference so that the tip stays on it. "
        f"{loops} loops: the tip over the command without compensation, over the reference with "
        "it; lines are the true tip, dots the estimate. A narrow loop on the dashed line, an ideal "
        "tip, is the goal. The first period, in which the offsets are estimated, is thin."
    )


def demo_report(demo: Demo, figures: Iterable[tuple[Figure, str]], film: bytes) -> str:
    """The page of ``tautscope demo``, with an animated GIF of the operator's motion."""
    seeds, profiles = demo.seeds, demo.by_profile
    several = len(seeds) > 1
    count = f"{len(seeds)} seeds" if several else "one seed"
    facts = {
        "tautscope": __version__,
        "Python": platform.python_version(),
        **{name: installed_version(name) for name in ("numpy", "mujoco", "opencv-python-headless")},
        "machine": f"{platform.system()} {platform.machine()}",
        "seeds": ", ".join(map(str, seeds)),
        "simulated": f"{demo.sim_seconds:.0f} s in {(3 + len(profiles)) * len(seeds)} runs",
        "took": f"{demo.wall_seconds:.0f} s",
    }
    lines = (escape(line).replace(" %", "&nbsp;%") for line in demo.verdict)
    verdict = "".join(f'<p class="verdict">{line}</p>' for line in lines)
    return report.page(
        f"on a simulated instrument, camera images the only feedback; {count}",
        f"""{verdict}
{report.embedded(film, "gif", _FILM_CAPTION)}
{report.figure_list(figures)}
<h2>Table 1</h2>
<div class="wide">{report.figures_table(profiles, ROWS, "true tip")}</div>
<p class="note">{"Median over the seeds, the worst seed in brackets. " if several else ""}{
            " ".join(_PROFILES[name] for name in profiles)
        }
Widths over the last two periods of each degree of freedom: mean over 41 levels across the central
80&nbsp;% of the tip&rsquo;s range, of the true tip unless stated otherwise.</p>
{report.row_explanations(ROWS, profiles.get("best", ()))}
{report.operator_section(demo.config.profile, demo.operator_results)}
{report.warning_list(demo.warnings)}
<h2>Limits of these results</h2>
{_CAVEATS}""",
        facts,
        demo.config,
    )
