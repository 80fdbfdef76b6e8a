"""A sweep whose configured pose is wrong, also so wrong that no posture fits the bands."""

import numpy as np
import pytest
from tautscope.calibration.geometry.recording import Recorder
from tautscope.config import load_config
from tautscope.twin.drawn_rig import draw_rig
from tautscope.twin.rig import Twin


@pytest.mark.parametrize(("turn", "is_detected"), [(0.0, True), (0.3, False)])
def test_bands_are_found_by_the_detection_or_by_their_colour(
    turn: float, is_detected: bool
) -> None:
    """As far as drawn rigs are off, and by another angle (rad)."""
    nominal = load_config()
    about_x, about_y, about_z = nominal.camera.camera_from_guide.rotation
    told = nominal.replace(
        **{"camera.camera_from_guide.rotation": (about_x, about_y + turn, about_z)}
    )
    twin = Twin(draw_rig(nominal, 0))
    recorder, truth, found = Recorder(told), [], []
    sample = twin.reset()
    phase = 0.0
    while len(truth) < 6:
        phase += told.control.period
        sample = twin.step(
            [0.025 + 0.012 * np.sin(phase), 1.5 * np.sin(phase), 0.9 + 0.5 * np.sin(phase)]
        )
        recorder.add_tick(sample.time, sample.applied)
        frame = sample.frame
        if frame is not None and frame.sequence % 20 == 0:
            found.append(recorder.add_image(frame.image, frame.captured_at).valid)
            truth.append(frame.true_features)
    twin.close()
    assert any(found) == is_detected
    error = recorder.recording().features - np.array(truth)
    assert np.isfinite(error).all(axis=1).mean() > 0.8
    assert np.nanmax(np.abs(error)) < 3
