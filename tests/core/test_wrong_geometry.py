"""Profile `best` where the geometry is not as configured: visible bands are not refused for it."""

import numpy as np
import pytest
from numpy.typing import NDArray
from simulated_plays import REST, WIDTHS, config, reference, run

Floats = NDArray[np.float64]


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


def wide_motion(time: float) -> Floats:
    """Sines of incommensurate periods in all DOFs."""
    waves = np.sin(np.array([0.63, 0.86, 0.73]) * time)
    return REST + np.array([15e-3, 1.5, 0.7]) * waves


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("off", [(0.0, 0.0), (30.0, 0.0), (0.0, -30.0)])
def test_a_shift_of_the_image_is_estimated_and_reported(
    off: tuple[float, float], seed: int
) -> None:
    """The configured principal point is `off` px from the camera's: 0 or 3.4 deg."""
    actual = config()
    told = actual.replace(
        **{"camera.cx": actual.camera.cx - off[0], "camera.cy": actual.camera.cy - off[1]}
    )
    found = run(told, seed=seed, until=90.0, begin=np.inf, actual=actual, motion=wide_motion)
    estimate = found.loop.hysteresis
    assert estimate is not None
    message = f"seed {seed}: {estimate.image_shift} px, std {estimate.image_shift_std} px"
    np.testing.assert_allclose(estimate.image_shift, off, atol=9.0, err_msg=message)
    latched = found.loop.supervision.latched
    assert ("geometry_off" in latched) == (off != (0.0, 0.0)), f"{message}; {latched}"
