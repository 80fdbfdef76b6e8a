"""With camera images, no image whose bands are visible is refused."""

from contextlib import closing

import numpy as np
import pytest
from instruments.properties import draw_instrument
from instruments.rows import REFUSED
from instruments.runs import LEAST_SEPARATION, LEAST_VISIBLE
from tautscope.config import Config, load_config
from tautscope.loop.reduction import HysteresisReduction, Report
from tautscope.loop.references import OperatorMotion
from tautscope.loop.rig import Frame
from tautscope.runs.experiment import run_experiment
from tautscope.twin import Twin

DURATION = 30.0
MOST = 0.005
"""Share of the images with visible bands that may be refused."""
INSTRUMENTS = (1000, 1008)
"""Seeds of drawn instruments with which settings were chosen."""


def refused_share(actual: Config, told: Config, seed: int) -> float:
    """Share of the images with visible bands that are refused under an operator's motion."""
    statuses: list[str] = []

    def look(loop: HysteresisReduction, frame: Frame) -> Report:
        report = loop.on_frame(frame)
        assert frame.true_features is not None
        assert frame.true_visible is not None
        distance = np.hypot(*(frame.true_features[2:] - frame.true_features[:2]))
        if frame.true_visible.min() >= LEAST_VISIBLE and distance >= LEAST_SEPARATION:
            statuses.append(str(report.status))
        return report

    motion = OperatorMotion(told.experiment, seed, DURATION)
    with closing(Twin(actual)) as rig:
        run_experiment(rig, motion, told, look=look)
    refused = [status for status in statuses if status in REFUSED]
    print(f"seed {seed}: {len(refused)} of {len(statuses)} refused")
    assert len(statuses) > 400
    return len(refused) / len(statuses)


@pytest.mark.parametrize("seed", [30, 33])
def test_images_with_visible_bands_are_used(seed: int) -> None:
    config = load_config().replace(**{"twin.seed": seed})
    assert refused_share(config, config, seed) <= MOST


@pytest.mark.parametrize("seed", INSTRUMENTS)
def test_they_are_used_where_the_loop_is_told_a_wrong_geometry(seed: int) -> None:
    drawn = draw_instrument(seed)
    assert refused_share(drawn.actual, drawn.told, seed) <= MOST
