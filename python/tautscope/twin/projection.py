"""Motion of the marker bands in the image, from the plant's centreline and OpenCV's projection."""

import cv2
import numpy as np

from tautscope.config import Config
from tautscope.twin.fault_state import Floats
from tautscope.twin.plant import Plant

_STEP = 1e-4
"""Insertion over which the motion of the features is measured [m]."""


def channel_jacobian(config: Config, plant: Plant) -> Floats:
    """(4,) [px/m] motion of the band centres in the image per insertion of the instrument."""
    camera, instrument = config.camera, config.instrument
    matrix = np.array([[camera.fx, 0, camera.cx], [0, camera.fy, camera.cy], [0, 0, 1.0]])
    pose = camera.camera_from_guide
    points, directions = plant.centreline()
    markers = np.array((instrument.marker_a, instrument.marker_b))[:, None]
    bands = points[-2] + markers * directions[-2]
    ends = np.vstack([bands, bands + np.array([0.0, 0.0, _STEP])])
    pixels, _ = cv2.projectPoints(
        ends,
        np.array(pose.rotation),
        np.array(pose.translation),
        matrix,
        np.array(camera.distortion),
    )
    return np.asarray(np.diff(pixels.reshape(2, 4), axis=0)[0] / _STEP, dtype=np.float64)
