"""A sweep whose configured pose is so wrong that the marker detection finds no posture."""

import numpy as np
from tautscope.calibration.geometry.recording import Recorder
from tautscope.config import load_config
from tautscope.twin.drawn_rig import draw_rig
from tautscope.twin.rig import Twin


def test_bands_are_found_by_their_colour() -> None:
    told = load_config()
    twin = Twin(draw_rig(told, 0))
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
    assert not any(found)
    error = recorder.recording().features - np.array(truth)
    assert np.isfinite(error).all(axis=1).mean() > 0.8
    assert np.nanmax(np.abs(error)) < 3
