"""Input devices that are slower or coarser than the loop, which compensates as with a fast one."""

import numpy as np
import pytest
from tautscope.config import from_document
from tautscope.loop.reduction import HysteresisReduction
from tautscope.runs.play_rig import PlayRig

DOF = {"name": "x", "unit": "m", "width_limit": 6e-3, "expected_width": 4e-3,
       "range": [-0.02, 0.02], "speed": 0.05}  # fmt: skip


def error(every: int = 1, count: float = 0.0, age: float = 0.05) -> float:
    """RMS of the tip's error [m] in the second half of a sine of 10 mm, from 60 s of which a device
    gives one value in so many ticks, as a whole number of counts [m]."""
    config = from_document({"dof": [DOF], "safety": {"reference_age": age}})
    rig, loop = PlayRig(config, [4e-3]), HysteresisReduction(config)
    period, sample, errors = config.control.period, rig.reset(), []
    given = 0.0
    for tick in range(round(60.0 / period)):
        wanted = 0.01 * np.sin(0.6 * tick * period)
        if tick % every == 0:
            given = round(wanted / count) * count if count else wanted
        sample = rig.step(loop.step([given], sample.time))
        for tip in sample.measurement:
            loop.on_tip(tip.values, tip.captured_at)
        errors.append(sample.true_state[0] - wanted)
    return float(np.sqrt(np.mean(np.square(errors[len(errors) // 2 :]))))


@pytest.fixture(scope="module")
def fast() -> float:
    return error()


@pytest.mark.parametrize(
    ("every", "count", "age", "most"),
    [(2, 0.0, 0.05, 0.02), (4, 0.0, 0.05, 0.05), (10, 0.0, 0.1, 0.15), (1, 5e-5, 0.05, 0.1)],
)
def test_the_error_hardly_grows(
    every: int, count: float, age: float, most: float, fast: float
) -> None:
    """By `most` [mm], of a slack of 4 mm."""
    assert 0 < 1e3 * error(every, count, age) < 1e3 * fast + most
