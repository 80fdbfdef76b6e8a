"""Figures of merit, tables and figure of a robot with [[dof]], from runs with known errors."""

from dataclasses import replace

import numpy as np
import pytest
from tautscope.config import axes
from tautscope.errors import RecordError
from tautscope.log.comparison import estimation_quality, replay_figure
from tautscope.log.stored_run import read_run
from tautscope.loop.references import Segment
from tautscope.report.recorded_run import RecordedRun
from tautscope.runs.recording import Recording, trace_columns, update_columns

CONFIG = axes(5, width_limit=1.0, names=["lift", "swing", "turn", "bend", "grip"])
NAMES = [dof.label for dof in CONFIG.dofs]
TIME = np.arange(0.0, 20.0, 0.02)
STEPS = 1e-3 * np.arange(1, 6)
"""Error of each degree of freedom with compensation [rad]; without it three times that."""


def recording(share: float, *, compensated: bool, knows_tip: bool = True) -> Recording:
    """A run in which the first degree of freedom moves first."""
    trace = np.zeros(len(TIME), trace_columns(CONFIG.dofs))
    frames = np.zeros(100, update_columns(CONFIG))
    trace["time"] = TIME
    frames["captured_at"] = TIME[::10]
    for index, (name, error) in enumerate(zip(NAMES, share * STEPS, strict=True)):
        reference = 0.4 * np.sin((1 + index) * TIME)
        trace[f"reference_{name}"] = trace[f"command_{name}"] = reference
        trace[f"true_{name}"] = reference + error if knows_tip else np.nan
        trace[f"delta_plus_{name}"] = 0.1 * (1 + index)
        frames[f"estimate_{name}"] = (reference + error)[::10]
        frames[f"observable_{name}"] = True
    return Recording(trace, frames, CONFIG, compensated, (Segment(CONFIG.dof[0], 0.0, 5.0, 2),))


@pytest.mark.parametrize(("knows_tip", "tip"), [(True, "of the true tip"), (False, "by sensor")])
def test_figures_are_of_each_degree_of_freedom(knows_tip: bool, tip: str) -> None:
    run = RecordedRun(
        recording(1.0, compensated=True, knows_tip=knows_tip),
        recording(-3.0, compensated=False, knows_tip=knows_tip),
    )
    assert run.tip == tip
    found = run.to_json()
    assert list(found) == NAMES
    for index, figures in enumerate(found.values()):
        assert figures["compensated_rms"] == pytest.approx(STEPS[index])
        assert figures["uncompensated_rms"] == pytest.approx(3 * STEPS[index])
        assert figures["reduction"] == pytest.approx(2 / 3)
        assert figures["slack"] == pytest.approx(0.1 * (1 + index))
        assert figures["bound"] is None
    section = run.section()
    assert all(f"<th>{name} [rad]</th>" in section for name in NAMES)
    assert "goal" not in section
    assert len(run.figure()[1].axes) == len(replay_figure(run.main).axes) == 10


@pytest.mark.parametrize("is_short", ["compensated", "uncompensated"])
def test_runs_are_compared_while_both_last(is_short: str) -> None:
    """The error grows with time, three times as fast without compensation."""
    runs = []
    for share, name in ((-3.0, "uncompensated"), (1.0, "compensated")):
        run = recording(0.0, compensated=name == "compensated")
        for dof in NAMES:
            run.trace[f"true_{dof}"] += share * TIME
        count = len(TIME) * 3 // 4 if name == is_short else len(TIME)
        runs.append(replace(run, trace=run.trace[:count]))
    for found in RecordedRun(runs[1], runs[0]).to_json().values():
        assert found["reduction"] == pytest.approx(2 / 3)


def test_slack_wider_than_the_travel_is_unknown() -> None:
    run = recording(1.0, compensated=True)
    run.trace["delta_plus_turn"] = 0.79
    run.trace["delta_plus_bend"] = 0.81
    run.trace["delta_plus_grip"] = 0.0
    widths = {name: found["width"] for name, found in estimation_quality(run).items()}
    assert widths["turn"] == pytest.approx(0.79)  # the command travels 0.8 rad
    assert np.isnan([widths["bend"], widths["grip"]]).all()


def test_both_runs_are_of_one_robot(tmp_path) -> None:
    for name, run in (
        ("with", recording(1.0, compensated=True)),
        ("without", recording(1.0, compensated=False)),
    ):
        run.save(tmp_path / name)
    found = read_run(tmp_path / "with", tmp_path / "without")
    assert list(found.to_json()) == NAMES
    assert found.main.segments == recording(1.0, compensated=True).segments
    text = (tmp_path / "without" / "config.toml").read_text()
    (tmp_path / "without" / "config.toml").write_text(text.replace('"grip"', '"hold"'))
    for kind in ("trace", "frames"):
        table = tmp_path / "without" / f"{kind}.csv"
        table.write_text(table.read_text().replace("_grip", "_hold"))
    with pytest.raises(RecordError, match="a run of the same degrees of freedom"):
        read_run(tmp_path / "with", tmp_path / "without")
