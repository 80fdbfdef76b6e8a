"""An operator's motion on any robot without and with compensation: figures and run folder."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from tautscope.config import Config, Sine
from tautscope.errors import ConfigError
from tautscope.loop.references import OperatorMotion
from tautscope.loop.rig import Rig
from tautscope.report.operator_motion import evaluated_after
from tautscope.runs.experiment import run_experiment
from tautscope.runs.output_folder import new_folder
from tautscope.runs.recording import Recording, per_dof

AMPLITUDE = 0.3
"""Amplitude of the motion about the middle of a range [share of the range]."""


@dataclass(frozen=True, slots=True)
class RobotResult:
    """Figures of one degree of freedom [m or rad], after `evaluated_after`.

    Attributes:
        name: Of the degree of freedom.
        unit: In which the figures are shown: mm or rad.
        uncompensated_rms: RMS of tip less reference without compensation.
        compensated_rms: With compensation.
        reduction: 1 - compensated_rms / uncompensated_rms.
        largest: Largest difference of tip and reference with compensation.
        slack: Width of the slack found, at the end.
    """

    name: str
    unit: str
    uncompensated_rms: float
    compensated_rms: float
    reduction: float
    largest: float
    slack: float


@dataclass(frozen=True)
class RobotRun:
    """Recordings without, where there is one, and with compensation."""

    uncompensated: Recording | None
    compensated: Recording

    @property
    def results(self) -> list[RobotResult]:
        """The figures of each degree of freedom."""
        after, dofs = evaluated_after(self.compensated), self.compensated.config.dofs
        rms = self.compensated.tracking_rms(after)
        first = self.uncompensated
        before = (
            np.full(len(dofs), np.nan)
            if first is None
            else first.tracking_rms(min(after, evaluated_after(first)))
        )
        largest = np.fmax.reduce(np.abs(self.compensated.tracking_error(after)), axis=0)
        trace = self.compensated.trace
        slack = (per_dof(trace, "delta_plus", dofs) - per_dof(trace, "delta_minus", dofs))[-1]
        return [
            RobotResult(
                dof.label,
                dof.display_unit,
                float(before[index]),
                float(rms[index]),
                float(1 - rms[index] / before[index]),
                float(largest[index]),
                float(slack[index]),
            )
            for index, dof in enumerate(dofs)
        ]

    def to_json(self) -> dict[str, Any]:
        """Figures in m and rad."""
        return {
            "profile": self.compensated.config.profile,
            "dofs": [asdict(result) for result in self.results],
            "warnings": list(self.compensated.warnings),
        }


def motion_of(config: Config, seed: int, duration: float) -> OperatorMotion:
    """An operator's motion over the ranges of the degrees of freedom.

    Raises:
        ConfigError: A degree of freedom has no range.
    """
    if not config.dof:
        return OperatorMotion(config.experiment, seed, duration)
    sines = []
    for index, dof in enumerate(config.dof):
        if dof.range is None:
            raise ConfigError(f"dof[{index}].range", None, "a range, within which the tip moves")
        low, high = dof.range
        sines.append(Sine(centre=(low + high) / 2, amplitude=AMPLITUDE * (high - low)))
    return OperatorMotion(sines, seed, duration)


def run_robot(
    make_rig: Callable[[Config], Rig],
    config: Config,
    motion: OperatorMotion,
    progress: Callable[[float], None],
) -> RobotRun:
    """Run a motion without, then with compensation, each on a new rig, which is closed.

    Raises:
        TautscopeError: As `run_experiment`.
    """
    runs: list[Recording] = []

    def report(now: float, end: float) -> None:
        progress((len(runs) + min(now / end, 1.0)) / 2)

    for compensate in (False, True):
        rig = make_rig(config)
        try:
            runs.append(run_experiment(rig, motion, config, compensate, report))
        finally:
            rig.close()
    return RobotRun(*runs)


def write_robot_folder(run: RobotRun, folder: Path) -> None:
    """Make the folder: recordings, configuration, results.json and motion.png.

    Raises:
        OutputError: The folder is not empty, or cannot be written.
    """
    from tautscope.figure_style import save_png, style  # noqa: PLC0415  matplotlib
    from tautscope.report.operator_figure import draw_operator_motion  # noqa: PLC0415

    with new_folder(folder) as place:
        if run.uncompensated is not None:
            run.uncompensated.write(place, "_uncompensated")
        run.compensated.write(place)
        text = json.dumps(run.to_json(), indent=1, allow_nan=False)
        (place / "results.json").write_text(text + "\n", encoding="utf-8")
        with style():
            save_png(
                draw_operator_motion(run.uncompensated, run.compensated), place / "motion.png", 150
            )
