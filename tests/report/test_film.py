"""The film of a motion without and with compensation."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from tautscope.config import load_config
from tautscope.loop.references import OperatorMotion
from tautscope.report.film import RATE, SECONDS, WIDTH, replayed, write_film
from tautscope.runs.experiment import run_experiment
from tautscope.runs.recording import per_dof
from tautscope.twin import Twin


@pytest.mark.parametrize("compensate", [False, True])
def test_the_film_shows_the_motion_of_the_run(compensate: bool) -> None:
    """A new twin that gets the recorded commands is where the run's was, to the last bit."""
    config = load_config()
    motion = OperatorMotion(config.experiment, seed=1, duration=3.0)
    run = run_experiment(Twin(config), motion, config, compensate)
    truth = [rig.plant.true_state for rig, _ in replayed(run)]
    # A row of the trace has the tip before its command.
    np.testing.assert_array_equal(truth[:-1], per_dof(run.trace, "true")[1:])


def test_a_film_has_ten_seconds_of_both_runs(tmp_path: Path) -> None:
    config = load_config()
    motion = OperatorMotion(config.experiment, seed=1, duration=SECONDS + 1.0)
    free = run_experiment(Twin(config, images=False), motion, config, compensate=False)
    moved = run_experiment(Twin(config, images=False), motion, config, compensate=True)
    write_film(tmp_path / "film.gif", free, moved)
    with Image.open(tmp_path / "film.gif") as film:
        assert film.n_frames == SECONDS * RATE
        assert film.size[0] == 2 * WIDTH
        assert film.info["duration"] == 1e3 / RATE
        film.seek(film.n_frames // 2)
        frame = np.asarray(film.convert("RGB"), dtype=float)
    left, right = frame[80:, :WIDTH], frame[80:, WIDTH:]
    assert np.abs(left - right).max() > 50, "the tips are apart"
    assert (right[..., 1] - right[..., 0]).max() > 40, "the green bands keep their colour"
