"""Figures of merit, tables, figures and report of a recorded run."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tautscope._core import __version__
from tautscope.dof import NamedDof
from tautscope.report import report, tables
from tautscope.report.operator_motion import OperatorResults, evaluate_operator_motion
from tautscope.report.results import Figures, Results, evaluate
from tautscope.report.tables import finite, operator_to_json
from tautscope.runs.recording import Recording, per_dof

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class RecordedRun:
    """A run, and perhaps one of the same reference without compensation to compare it with.

    A run of the article's instrument with segments is its experiment, any other another motion.

    Attributes:
        main: The run, with compensation or without.
        uncompensated: One without, if `main` has compensation and there is one.
        source: File or folder that `main` was read from, if any.
    """

    main: Recording
    uncompensated: Recording | None = None
    source: Path | None = None

    @property
    def is_experiment(self) -> bool:
        """Whether the run is the article's experiment."""
        return bool(self.main.segments) and not self.main.config.dof

    @property
    def is_tip_known(self) -> bool:
        """Whether the true state of the tip is recorded; otherwise it is the one measured."""
        return bool(np.isfinite(per_dof(self.main.trace, "true", self.main.config.dofs)).any())

    @property
    def tip(self) -> str:
        """Whose errors the figures are."""
        if self.is_tip_known:
            return "of the true tip"
        return "by sensor" if self.main.config.dof else "by camera"

    @property
    def results(self) -> Results:
        """Table 1 of the experiment; NaN where it needs both runs, or the true tip.

        Empty for another motion.
        """
        if not self.is_experiment:
            return {}
        if not self.main.compensated:
            return _without_compensation(evaluate(self.main, self.main))
        return evaluate(self.uncompensated, self.main)

    @property
    def operator_results(self) -> OperatorResults:
        """Tracking of another motion, of `tip`; empty for the experiment."""
        if self.is_experiment:
            return {}
        if not self.main.compensated:
            found = evaluate_operator_motion(self.main, self.main, has_bound=False)
            return _without_compensation(found)
        return evaluate_operator_motion(self.uncompensated, self.main)

    def to_json(self) -> dict[str, Any]:
        """Per DOF the figures by camera, or of another motion by the true tip where it is known.

        In m or rad; None if unknown.
        """
        return {
            dof.label: finite(
                {
                    "uncompensated": found.uncompensated_estimate,
                    "compensated": found.compensated_estimate,
                    "reduction": found.reduction_estimate,
                    "tracking_rms": found.tracking_estimate,
                }
            )
            for dof, found in self.results.items()
        } | operator_to_json(self.operator_results)

    def summary(self) -> dict[str, Any]:
        """The results as JSON: `to_json`, and what they are of."""
        return {
            "profile": self.main.config.profile,
            "is_compensated": self.main.compensated,
            "ticks": len(self.main.trace),
            "updates": len(self.main.frames),
            "is_tip_known": self.is_tip_known,
            "dof": self.to_json(),
            "warnings": list(self.main.warnings),
        }

    def write_report(
        self,
        place: Path,
        facts: Mapping[str, str],
        further: Iterable[tuple[str, Figure, str]] = (),
    ) -> None:
        """Write report.html, its figures, and table1.csv of the experiment, to an existing folder.

        Args:
            place: The folder.
            facts: Further facts of the run.
            further: Files and captions of further figures.
        """
        # Matplotlib takes half a second to import.
        from tautscope.figure_style import style  # noqa: PLC0415
        from tautscope.report.figures import figure5  # noqa: PLC0415

        config, pictures = self.main.config, [self.figure(), *further]
        if self.main.snapshot is not None:
            drawn = figure5(self.main.snapshot, config)
            pictures.append(("fig5.png", drawn, report.FIGURE5_CAPTION))
        if results := self.results:
            tables.write_csv(place / "table1.csv", [config.twin.seed], {config.profile: [results]})
        with style():
            for name, figure, _ in pictures:
                figure.savefig(place / name)
            text = report.page(
                "on the rig named below",
                f"""{self.section()}
{report.warning_list(self.main.warnings)}
<h2>Figures</h2>
{report.figure_list(each[1:] for each in pictures)}""",
                {"tautscope": __version__, **facts},
                config,
            )
        (place / "report.html").write_text(text, encoding="utf-8")

    def section(self) -> str:
        """The tables as HTML."""
        if self.is_experiment:
            return report.table1_section(self.results, is_tip_known=self.is_tip_known)
        return report.recorded_motion_section(self.operator_results, self.tip)

    def figure(self) -> tuple[str, Figure, str]:
        """Name of its file, figure and caption."""
        # Matplotlib takes half a second to import.
        from tautscope.report.figures import figure9  # noqa: PLC0415
        from tautscope.report.operator_figure import draw_operator_motion  # noqa: PLC0415

        if self.is_experiment:
            return (
                "fig9.png",
                figure9(self.uncompensated, self.main),
                "Fig. 9. First row: reference, command, estimate and both "
                "contact offsets. Second row: loops of the estimate, and of the true tip where it "
                "is known; a narrow loop on the dashed line, an ideal tip, is the goal. The first "
                "period, in which the slack is estimated, is thin.",
            )
        return (
            "tracking.png",
            draw_operator_motion(self.uncompensated, self.main),
            f"The motion, figures {self.tip}. Left: reference, command and tip, in a part of the "
            "run. Right: tracking error over the whole run.",
        )


def _without_compensation(results: dict[NamedDof, Figures]) -> dict[NamedDof, Figures]:
    """Figures of a run without compensation: those of compensation are NaN."""
    of_compensation = ("compensated", "reduction", "start", "largest")
    known = {}
    for dof, found in results.items():
        unknown = [each.name for each in fields(found) if each.name.startswith(of_compensation)]
        known[dof] = replace(found, **dict.fromkeys(unknown, math.nan))
    return known
