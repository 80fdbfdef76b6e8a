"""A simulated rig that differs from its configuration."""

import numpy as np
import pytest
from tautscope.config import CalibrationRecord, Config, load_config
from tautscope.errors import ConfigError
from tautscope.twin.board import BoardCamera
from tautscope.twin.camera import TwinCamera
from tautscope.twin.drawn_rig import BAND, CENTRE, DELAY, FOCAL_LENGTH, SECTION, SHIFT, draw_rig

OWN = {
    "camera.width": 1280,
    "camera.height": 720,
    "camera.fx": 700.0,
    "camera.camera_from_guide.translation": (0.01, -0.012, 0.02),
    "instrument.bending_length": 0.025,
    "instrument.tip_length": 0.03,
    "instrument.marker_a": 0.006,
    "instrument.marker_b": 0.024,
}


def test_the_rig_is_drawn_about_its_configuration() -> None:
    told = load_config().replace(**OWN)
    actual = draw_rig(told, 5)
    camera, instrument = actual.camera, actual.instrument
    assert (camera.width, camera.height) == (1280, 720)
    assert 0 < abs(camera.fx / 700 - 1) <= FOCAL_LENGTH
    shift = np.subtract(camera.camera_from_guide.translation, (0.01, -0.012, 0.02))
    assert 0 < np.linalg.norm(shift) <= SHIFT
    assert 0 < abs(instrument.bending_length / 0.025 - 1) <= SECTION
    assert 0 < abs(instrument.marker_a - 0.006) <= BAND
    assert 0 < abs(instrument.marker_b - 0.024) <= BAND
    assert draw_rig(told, 6).camera != actual.camera


def test_bands_that_nearly_touch_stay_apart() -> None:
    told = load_config().replace(**{"instrument.marker_b": 0.0082})
    for seed in range(20):
        assert draw_rig(told, seed).instrument != told.instrument


def test_what_was_calibrated_on_the_twin_stays() -> None:
    told, actual = load_config(), draw_rig(load_config(), 5)
    record = CalibrationRecord(
        date="2026-01-01T00:00:00+00:00",
        serial_numbers={"twin": "5"},
        std={"camera.fx": 0.5, "camera.distortion[0]": 0.01},
    )
    calibrated = told.replace(**{"camera.fx": 430.0, "calibration.geometry": record})
    again = draw_rig(calibrated, 5)
    assert again.camera.fx == 430
    assert again.camera.distortion == told.camera.distortion
    assert again.camera.cx == actual.camera.cx
    assert again.twin == actual.twin
    assert draw_rig(calibrated, 6).camera.fx != 430


def test_a_fisheye_that_was_calibrated_on_the_twin_stays() -> None:
    """Its distortion is that of the pinhole nearest to it, and has no standard deviations."""
    record = CalibrationRecord(
        date="2026-01-01T00:00:00+00:00",
        serial_numbers={"twin": "5"},
        std={f"camera.{key}": 0.1 for key in ("fx", "fy", "cx", "cy")},
    )
    distortion = (-0.1, 0.02, 0.0, 0.0, 0.003, 0.01, 0.0, 0.0)
    changes = {"camera.distortion": distortion, "calibration.camera": record}
    assert draw_rig(load_config().replace(**changes), 5).camera.distortion == distortion


def test_other_pixels_than_those_of_the_twin_are_refused() -> None:
    config = load_config().replace(**{"camera.pixel_format": "yuyv"})
    with pytest.raises(ConfigError, match=r"camera\.pixel_format"):
        TwinCamera(config)
    with pytest.raises(ConfigError, match=r"camera\.pixel_format"):
        BoardCamera(config, np.zeros((4, 4), np.uint8), 1e-3)


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
