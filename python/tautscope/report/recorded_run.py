"""Figures of merit, tables and figure of a recorded run."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from tautscope.report.operator_motion import (
    OperatorResults,
    evaluate_operator_motion,
    evaluate_uncompensated_motion,
)
from tautscope.report.report import CaptionedFigure, recorded_motion_section, table1_section
from tautscope.report.results import Results, evaluate, evaluate_uncompensated
from tautscope.report.tables import finite_or_none, operator_to_json
from tautscope.runs.recording import Recording, per_dof


@dataclass(frozen=True)
class RecordedRun:
    """A run, and perhaps one of the same reference without compensation to compare it with.

    A run of the article's instrument with segments is its experiment, any other another motion.

    Attributes:
        main: The run, with compensation or without.
        uncompensated: One without, if `main` has compensation and there is one.
    """

    main: Recording
    uncompensated: Recording | None = None

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
            return evaluate_uncompensated(self.main)
        return evaluate(self.uncompensated, self.main)

    @property
    def operator_results(self) -> OperatorResults:
        """Tracking of another motion, of `tip`; empty for the experiment."""
        if self.is_experiment:
            return {}
        if not self.main.compensated:
            return evaluate_uncompensated_motion(self.main)
        return evaluate_operator_motion(self.uncompensated, self.main)

    def to_json(self) -> dict[str, Any]:
        """Per DOF the figures by camera, or of another motion by the true tip where it is known.

        In m or rad; None if unknown.
        """
        return {
            dof.label: {
                "uncompensated": finite_or_none(found.uncompensated_estimate),
                "compensated": finite_or_none(found.compensated_estimate),
                "reduction": finite_or_none(found.reduction_estimate),
                "tracking_rms": finite_or_none(found.tracking_estimate),
            }
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

    def section(self) -> str:
        """The tables as HTML."""
        if self.is_experiment:
            return table1_section(self.results, is_tip_known=self.is_tip_known)
        return recorded_motion_section(self.operator_results, self.tip)

    def figure(self) -> tuple[str, CaptionedFigure]:
        """The figure and the name of its file."""
        # Matplotlib takes half a second to import.
        from tautscope.report.figures import figure9  # noqa: PLC0415
        from tautscope.report.operator_figure import draw_operator_motion  # noqa: PLC0415

        if self.is_experiment:
            return "fig9.png", CaptionedFigure(
                figure9(self.uncompensated, self.main),
                "Fig. 9. First row: reference, command, estimate and both "
                "contact offsets. Second row: loops of the estimate, and of the true tip where it "
                "is known; a narrow loop on the dashed line, an ideal tip, is the goal. The first "
                "period, in which the slack is estimated, is thin.",
            )
        return "tracking.png", CaptionedFigure(
            draw_operator_motion(self.uncompensated, self.main),
            f"The motion, figures {self.tip}. Left: reference, command and tip, in a part of the "
            "run. Right: tracking error over the whole run.",
        )
