"""A simulated rig that differs from its configuration."""

import numpy as np
from tautscope.config import Config, load_config
from tautscope.twin.drawn_rig import BAND, CENTRE, DELAY, FOCAL_LENGTH, SECTION, SHIFT, draw_rig


def test_the_rig_stays_while_its_configuration_is_calibrated() -> None:
    told = load_config("article_rig")
    actual = draw_rig(told, 5)
    calibrated = told.replace(
        **{
            "camera.fx": actual.camera.fx,
            "camera.source.delay": 0.1,
            "instrument.marker_a": actual.instrument.marker_a,
        }
    )
    again = draw_rig(calibrated, 5)
    assert again.instrument == actual.instrument
    assert again.twin == actual.twin
    assert again.camera.camera_from_guide == actual.camera.camera_from_guide
    assert draw_rig(told, 6).camera != actual.camera


def test_errors_are_spread_over_their_ranges() -> None:
    default = Config()
    rigs = [draw_rig(default, seed) for seed in range(40)]
    pose = np.array(default.camera.camera_from_guide.translation)
    shares = {
        "focal length": [(rig.camera.fx / default.camera.fx - 1) / FOCAL_LENGTH for rig in rigs],
        "centre": [(rig.camera.cx - default.camera.cx) / CENTRE for rig in rigs],
        "shift": [
            2 * np.linalg.norm(rig.camera.camera_from_guide.translation - pose) / SHIFT - 1
            for rig in rigs
        ],
        "section": [
            (rig.instrument.bending_length / default.instrument.bending_length - 1) / SECTION
            for rig in rigs
        ],
        "band": [(rig.instrument.marker_a - default.instrument.marker_a) / BAND for rig in rigs],
        "delay": [2 * rig.twin.sensor.stamp_error / DELAY - 1 for rig in rigs],
    }
    for name, values in shares.items():
        assert -1 <= min(values) < -0.7, name
        assert 0.7 < max(values) <= 1, name
