"""The loop with your own marker detector, here twenty lines of OpenCV.

The loop needs two centroids in px and the time of capture.
Run it with ``uv run python examples/own_detector.py``.
"""

import cv2
import numpy as np
from numpy.typing import NDArray
from own_rig import DrawnRig, short_experiment
from tautscope import Frame, HysteresisReduction, Report, run_experiment
from tautscope.references import SineSequence
from tautscope.report.results import evaluate

MINIMUM_AREA = 20
"""Smaller regions are noise [px^2]."""


def find_bands(
    image: NDArray[np.uint8], predicted: NDArray[np.float64] | None
) -> NDArray[np.float64] | None:
    """Centroids u, v of band A and of band B (4,) [px]: the two largest green regions."""
    blue, green, red = cv2.split(image)
    mask = (cv2.subtract(green, cv2.max(blue, red)) > 40).astype(np.uint8)
    _, _, stats, centroids = cv2.connectedComponentsWithStats(mask)
    areas = stats[1:, cv2.CC_STAT_AREA]  # component 0 is the background
    largest = 1 + np.argsort(areas)[:-3:-1]
    if predicted is None or len(largest) < 2 or areas[largest - 1].min() < MINIMUM_AREA:
        return None
    first, second = centroids[largest]
    if np.linalg.norm(first - predicted[:2]) > np.linalg.norm(second - predicted[:2]):
        first, second = second, first
    return np.concatenate([first, second])


def update(loop: HysteresisReduction, frame: Frame) -> Report:
    """Image update with the features of `find_bands`."""
    predicted = loop.predicted_features(frame.captured_at)
    return loop.on_features(find_bands(frame.image, predicted), frame.captured_at)


def main() -> None:
    config = short_experiment()
    reference = SineSequence(config.experiment)
    runs = [
        run_experiment(DrawnRig(config), reference, config, compensate, look=update)
        for compensate in (False, True)
    ]
    for dof, result in evaluate(*runs).items():
        print(f"{dof.label}: hysteresis reduced by {result.reduction:.0%}")


if __name__ == "__main__":
    main()
