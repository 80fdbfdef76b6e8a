"""A simulated rig that differs from its configuration, as a rig does before it is calibrated."""

from typing import Any

import cv2
import numpy as np

from tautscope.config import Config
from tautscope.config.calibration import TWIN

TILT = np.radians(5.0)
"""Largest angle between the configured and the actual guide, about a random axis [rad]."""
SHIFT = 5e-3
"""Largest distance, in a random direction [m]."""
FOCAL_LENGTH, SECTION = 0.03, 0.1
"""Largest errors of the focal lengths and of the length of the section [share]."""
CENTRE = 5.0
"""Of the principal point [px]."""
DISTORTION = 0.02
"""Of k1 [1]."""
BAND = 1e-3
"""Of the position of a band [m]."""
DELAY = 0.2
"""Largest delay from the capture of an image to its stamp [s]."""
INTRINSICS = tuple(f"camera.{key}" for key in ("fx", "fy", "cx", "cy", "distortion"))
"""Written by a calibration of the camera; the last without deviations if the lens is a fisheye."""
_DOMAIN = 18


def draw_values(config: Config, seed: int) -> dict[str, Any]:
    """The values of an actual rig by which it differs from its configuration.

    Focal lengths, principal point, k1, pose of the guide, length of the section and positions of
    the bands differ uniformly from the configured ones, the bands at most by what keeps them apart
    and on the tip. What was calibrated on the twin of this seed stays, so that the rig does while
    one calibration after the other is written. Images are stamped late by a drawn delay. The same
    seed gives the same rig. The keys are dotted paths, as for `Config.replace`.
    """
    random = np.random.default_rng([_DOMAIN, seed])
    camera, instrument = config.camera, config.instrument
    pose = camera.camera_from_guide
    axis, direction = (each / np.linalg.norm(each) for each in random.standard_normal((2, 3)))
    turn, _ = cv2.Rodrigues(random.uniform(0, TILT) * axis)
    nominal, _ = cv2.Rodrigues(np.array(pose.rotation))
    scale = 1 + random.uniform(-FOCAL_LENGTH, FOCAL_LENGTH)
    k1, *others = camera.distortion
    half = instrument.band_length / 2
    band = min(BAND, (instrument.marker_b - instrument.marker_a) / 2 - half)
    marker_a = max(instrument.marker_a + random.uniform(-band, band), half)
    marker_b = instrument.marker_b + random.uniform(-band, band)
    drawn = {
        "camera.fx": camera.fx * scale,
        "camera.fy": camera.fy * scale,
        "camera.cx": camera.cx + random.uniform(-CENTRE, CENTRE),
        "camera.cy": camera.cy + random.uniform(-CENTRE, CENTRE),
        "camera.distortion": [k1 + random.uniform(-DISTORTION, DISTORTION), *others],
        "camera.camera_from_guide.rotation": cv2.Rodrigues(turn @ nominal)[0].ravel().tolist(),
        "camera.camera_from_guide.translation": (
            pose.translation + random.uniform(0, SHIFT) * direction
        ).tolist(),
        "instrument.bending_length": instrument.bending_length
        * (1 + random.uniform(-SECTION, SECTION)),
        "instrument.marker_a": marker_a,
        "instrument.marker_b": min(marker_b, instrument.tip_length - half),
        "twin.sensor.stamp_error": random.uniform(0, DELAY),
        "twin.seed": seed,
    }
    records = (config.calibration.camera, INTRINSICS), (config.calibration.geometry, ())
    for record, written in records:
        if record is not None and record.serial_numbers.get(TWIN) == str(seed):
            for key in (*record.std, *written):
                drawn.pop(key.partition("[")[0], None)
    return drawn


def draw_rig(config: Config, seed: int) -> Config:
    """The configuration with the values of `draw_values`."""
    return config.replace(**draw_values(config, seed))


def draw_geometry(config: Config, seed: int) -> Config:
    """The rig of `draw_rig` with a calibrated camera, apart from its focal lengths."""
    kept = {f"camera.{key}": getattr(config.camera, key) for key in ("cx", "cy", "distortion")}
    return draw_rig(config, seed).replace(**kept)
