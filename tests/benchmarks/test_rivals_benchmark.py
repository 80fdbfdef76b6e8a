"""The rivals of `best`: their laws on ideal plays, the loss of images, and the rows of a cell."""

from argparse import Namespace

import numpy as np
import pytest
from common import processes
from common.paths import ROOT
from instruments.rival_controllers import Calibration, ConstantCompensation, VisualServoing
from instruments.rival_runs import RivalFigures, RivalRun, measure_loop, simulate
from instruments.rivals import (
    NAMES,
    RATES,
    SERVOING,
    TUNING_SEEDS,
    gains_of,
    plan,
    table,
    to_rows,
    tuning_table,
)
from numpy.typing import NDArray
from plants.simulated import HALF, PlantRig
from play_model import play
from tautscope.config import load_config
from tautscope.dof import Dof
from tautscope.loop.references import OperatorMotion
from tautscope.twin.fault_frames import FeatureFrame

CONFIG = load_config(profile="best")
CENTRE = np.array([CONFIG.experiment[dof].centre for dof in Dof])
GAIN, MINUS, PLUS = 0.8, -1.0, 3.0


def test_a_loop_is_measured_with_gain_and_contact_offsets() -> None:
    command = 10 * np.cos(np.linspace(0, 4 * np.pi, 4001))
    tip = play(GAIN * command, MINUS, PLUS, 0.0)
    gain, minus, plus = measure_loop(command[2000:], tip[2000:])
    assert gain == pytest.approx(GAIN, rel=0.01)
    assert (minus, plus) == (pytest.approx(MINUS, abs=0.05), pytest.approx(PLUS, abs=0.05))


def test_constant_compensation_inverts_a_play_with_gain() -> None:
    calibration = Calibration((GAIN,) * 3, (MINUS,) * 3, (PLUS,) * 3)
    law = ConstantCompensation(calibration, np.full(3, 100.0))
    reference = 5.0 + 10 * np.sin(np.linspace(0, 6 * np.pi, 6001))
    commands = np.array([law.step(np.full(3, value), 0.0)[0] for value in reference])
    tip = 5.0 + play(GAIN * (commands - 5.0), MINUS, PLUS, 0.0)
    late = slice(2000, None)
    assert np.abs(tip - reference)[late].max() < 0.1


def errors(rate: float, seconds: float = 40.0) -> NDArray[np.float64]:
    """RMS errors of ideal plays under an operator's motion with visual servoing."""
    rig, law = PlantRig(CONFIG, "independent plays"), VisualServoing(CONFIG, np.full(3, rate))
    motion = OperatorMotion(CONFIG.experiment, 1, seconds)
    sample, found = rig.reset(), []
    while sample.time < seconds:
        reference = motion(sample.time)
        command = law.step(reference, sample.time)
        assert sample.true_state is not None
        found.append(sample.true_state - reference)
        if sample.frame is not None:
            assert isinstance(sample.frame, FeatureFrame)
            law.update(sample.frame.features, sample.frame.captured_at)
        sample = rig.step(command)
    return np.asarray(np.sqrt(np.mean(np.square(found), axis=0)))


def test_visual_servoing_reduces_the_error_of_ideal_plays() -> None:
    free, servoed = errors(0.0), errors(3.0)
    assert np.all(free > 0.3 * HALF)
    assert np.all(servoed < 0.7 * free), servoed / free


def test_without_images_visual_servoing_is_no_compensation() -> None:
    gains = SERVOING[0.08]
    free, servoed = (
        simulate(RivalRun(1003, name, 0.08, 1.0, gains, 6.0, rest=0.0))
        for name in ("none", "visual servoing")
    )
    np.testing.assert_allclose(servoed.spread, free.spread, rtol=1e-9)


def test_what_has_no_images_is_run_once() -> None:
    runs = plan(range(2), (0.02, 0.25), (0.0, 0.5), 120.0)
    counts = {name: sum(run.name == name for run in runs) for name in NAMES}
    assert counts == {
        "none": 2,
        "best": 8,
        "visual servoing": 8,
        "constant compensation": 2,
    }
    assert gains_of("visual servoing", 0.2) == SERVOING[0.25]


def test_a_row_says_by_how_much_best_is_ahead() -> None:
    spreads = {"none": 1.0, "best": 0.2, "visual servoing": 0.5, "constant compensation": 0.1}
    found = {
        run: RivalFigures([spreads[run.name]] * 3, [10 * spreads[run.name]] * 3)
        for run in plan(range(3), (0.08,), (0.2,), 120.0)
    }
    rows = {(row["what"], row["dof"]): row for row in to_rows(found, (0.08,), (0.2,))}
    ahead = rows["80 ms, loss 20%: reduction above visual servoing's", "bending"]
    assert ahead["median"] == pytest.approx(0.3) and ahead["holds"] and ahead["n"] == 3
    behind = rows["80 ms, loss 20%: reduction above constant compensation's", "bending"]
    assert behind["median"] == pytest.approx(-0.1) and not behind["holds"]
    rest = rows["80 ms, loss 20%: creep below visual servoing's", "insertion"]
    assert rest["median"] == pytest.approx(3.0) and rest["unit"] == "m"
    assert "| 80 ms | 20% | reduction, % | 80 / 80 / 80 | 50 / 50 / 50 | 90 / 90 / 90 | |" in table(
        found, (0.08,), (0.2,)
    )


def test_tuning_shows_the_worst_instrument_of_each_gain(monkeypatch: pytest.MonkeyPatch) -> None:
    def run(run: RivalRun) -> RivalFigures:
        unstable = run.name == "visual servoing" and run.seed == TUNING_SEEDS[0]
        spread = 1.0 if run.name == "none" else 3.0 if unstable else 0.25
        return RivalFigures([spread] * 3, [0.0] * 3)

    monkeypatch.setattr(
        processes, "run_parallel", lambda _, jobs, *options: ((job, run(job)) for job in jobs)
    )
    text = tuning_table(Namespace(workers=1, scheduler=None))
    assert "| 20 ms | 3 / 3 / 3 | 75 / 75 / 75 | -200 / -200 / -200 |" in text
    assert "| 5 / 5 / 5 | 75 / 75 / 75 | 75 / 75 / 75 |" in text
    assert all(SERVOING[latency] in rates for latency, rates in RATES.items())


def test_the_page_has_a_section_for_the_table() -> None:
    page = (ROOT / "docs" / "instruments.md").read_text(encoding="utf-8")
    assert page.index("<!-- rivals: begin -->") < page.index("<!-- rivals: end -->")
