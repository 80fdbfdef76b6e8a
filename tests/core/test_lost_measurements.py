"""A loop without measurements: compensation fades, and the tip then follows as without it."""

import numpy as np
import pytest
from tautscope.config import from_document
from tautscope.loop.reduction import HysteresisReduction
from tautscope.runs.play_rig import PlayRig

DOF = {"name": "x", "unit": "m", "width_limit": 6e-3, "expected_width": 4e-3,
       "range": [-0.02, 0.02], "speed": 0.05}  # fmt: skip
LOST, END = 20.0, 60.0
CYCLE = 10.0
"""Of the reference, and of the error at the end [s]."""


def errors(compensate: bool, share: float = 1.0) -> np.ndarray:
    """Error of the tip [m] in the last cycle of 60 s, of which the tip is measured for 20 s."""
    config = from_document({"dof": [DOF]})
    rig, loop = PlayRig(config, [4e-3]), HysteresisReduction(config, compensate)
    sample, found = rig.reset(), []
    while sample.time < END:
        reference = 0.01 * np.sin(2 * np.pi * sample.time / CYCLE)
        if sample.time > LOST:
            loop.set_compensation(share)
        sample = rig.step(loop.step([reference], sample.time))
        for tip in sample.measurement:
            if tip.captured_at < LOST or share < 1:
                loop.on_tip(tip.values, tip.captured_at)
        if sample.time > END - CYCLE:
            found.append(sample.true_state[0] - reference)
    return np.array(found)


@pytest.mark.parametrize("share", [1.0, 0.0])
def test_the_tip_follows_as_without_compensation(share: float) -> None:
    """Half of the slack to each side, not all of it to one; also where it is switched off."""
    np.testing.assert_allclose(errors(True, share), errors(False), atol=1e-6)
