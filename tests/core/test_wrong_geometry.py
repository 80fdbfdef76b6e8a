"""Profile `best` where the geometry is not as configured: visible bands are not refused for it."""

from __future__ import annotations

import numpy as np
import pytest
from simulated_plays import WIDTHS, config, reference, run


@pytest.mark.parametrize("seed", range(4))
def test_bands_of_a_camera_that_is_off_are_used_and_compensated(seed: int) -> None:
    """The camera's pose is off by 2 mm and 2 deg in a random direction."""
    rng = np.random.default_rng(seed)
    shift, axis = (each / np.linalg.norm(each) for each in rng.standard_normal((2, 3)))
    told = config()
    pose = told.camera.camera_from_guide
    actual = told.replace(
        **{
            "camera.camera_from_guide.translation": list(
                map(float, pose.translation + 2e-3 * shift)
            ),
            "camera.camera_from_guide.rotation": list(
                map(float, pose.rotation + np.radians(2) * axis)
            ),
        }
    )
    found = run(told, seed=seed, until=40.0, begin=np.inf, actual=actual)
    late = [str(report.status) for report in found.reports[len(found.reports) // 2 :]]
    used = np.mean([status in ("ok", "held") for status in late])
    assert used >= 0.99, f"seed {seed}: {used:.1%} used"
    times = np.arange(len(found.tip)) * 0.005
    error = found.tip - np.array([reference(time) for time in times])
    left = error[times > 20.0].std(axis=0)[0]
    assert left < 0.4 * WIDTHS[0] / 2, f"seed {seed}: {1e3 * left:.2f} mm besides a constant shift"
