"""Long records: what is left out of them does not change the result."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from play_model import play
from tautscope._core import Play
from tautscope.analysis import comparison
from tautscope.analysis.identification import identify
from tautscope.analysis.models import constant_play
from tautscope.analysis.models.registry import LINEAR_FIT
from tautscope.analysis.models.task import extremes
from tautscope.config import load_config
from tautscope.runs.records import Cleaning, Record


def moving(samples: int, strokes: int) -> np.ndarray:
    turns = np.random.default_rng(3).uniform(-10, 10, strokes)
    return np.interp(np.linspace(0, strokes - 1, samples), np.arange(strokes), turns)


def test_the_width_of_a_long_record_is_that_of_its_turning_points() -> None:
    """Turns that lie between the samples of the fit; the tip is late by 60 samples."""
    samples = 100_000
    command = moving(samples, 667)
    noise = np.random.default_rng(1).normal(0, 0.02, samples)
    tip = np.roll(Play(delta_minus=-1.5, delta_plus=1.5, output=0.0).run(command), 60) + noise
    found = identify(np.arange(float(samples)), command, tip)
    assert found.is_identified
    assert found.width.low < 3 < found.width.high
    assert found.width.value == pytest.approx(3, rel=5e-3)
    assert found.delay.value == pytest.approx(60, abs=3)


def test_a_thinned_record_has_one_tip_per_part_and_all_extremes(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(comparison, "PARTS", 800)
    command = moving(20_000, 90)
    tip = play(command, -1.0, 2.0)
    tip[::3] = np.nan
    rows = np.arange(20_000)
    record = Record(command, tip, np.linspace(0, 199.99, 20_000), rows, Cleaning())
    thin, every = comparison.thinned(record)
    assert every == 25
    assert len(thin.rows) <= 3 * 800
    np.testing.assert_array_equal(thin.command, command[thin.rows])
    assert thin.time is not None
    np.testing.assert_allclose(thin.time, 0.01 * thin.rows)
    seen = np.isfinite(thin.measured)
    np.testing.assert_array_equal(thin.measured[seen], tip[thin.rows[seen]])
    for part in range(800):
        own = thin.rows // 25 == part
        assert np.count_nonzero(seen & own) == 1, part
        inside = command[25 * part : 25 * part + 25]
        assert (thin.command[own].min(), thin.command[own].max()) == (inside.min(), inside.max())
    fits = [constant_play.fit(each.command, each.measured) for each in (record, thin)]
    assert fits[1].width == pytest.approx(fits[0].width, rel=1e-3)
    found = comparison.analyze(record, load_config(), models=(LINEAR_FIT,))
    assert (found.every, found.to_json()["every"]) == (25, 25)


def test_extremes_draw_the_same_line() -> None:
    values = np.random.default_rng(2).normal(size=1003)
    kept = extremes(values, 10)
    assert (np.diff(kept) > 0).all()
    for begin in range(0, 1003, 10):
        own = values[kept[(kept >= begin) & (kept < begin + 10)]]
        part = values[begin : begin + 10]
        assert (own.min(), own.max()) == (part.min(), part.max())


@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="threads as Linux lists them")
def test_commands_use_one_thread_of_blas() -> None:
    program = (
        "import os, tautscope.cli, numpy as np; a = np.ones((600, 600)); a @ a; "
        "print(len(os.listdir('/proc/self/task')))"
    )
    kept = {name: value for name, value in os.environ.items() if "NUM_THREADS" not in name}
    run = [sys.executable, "-c", program]
    counted = subprocess.run(run, env=kept, capture_output=True, text=True, check=True).stdout
    assert counted.strip() == "1"
