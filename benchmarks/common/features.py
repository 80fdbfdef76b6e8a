"""True marker features with noise in place of camera images, for runs without rendering."""

from collections import deque

import numpy as np
from tautscope.config import Config
from tautscope.loop.construction import build_feature_model
from tautscope.loop.reduction import HysteresisReduction, Report
from tautscope.loop.rig import Frame, Sample
from tautscope.twin.fault_frames import FeatureFrame

NO_IMAGE = np.empty((0, 0, 3), np.uint8)
NOISE = 0.2
"""Standard deviation of the feature noise [px]."""


class FeatureCamera:
    """Camera that delivers features of the true state, with noise, at the camera's rate and delay.

    The features are those of the loop's own feature model.
    """

    def __init__(self, config: Config) -> None:
        self._twin = config.twin
        self.model = build_feature_model(config)
        self._noise = np.random.default_rng([config.twin.seed, 1])
        self._every = round(1 / (config.twin.frame_rate * config.control.period))
        self._tick = 0
        self._pending: deque[Frame] = deque()

    def capture(self, sample: Sample) -> Frame | None:
        """Return the frame that arrives with a sample, if any."""
        if self._tick % self._every == 0 and sample.true_state is not None:
            predicted = self.model.predict(sample.true_state)
            if predicted is not None:
                noisy = predicted[0] + NOISE * self._noise.standard_normal(4)
                self._pending.append(
                    FeatureFrame(NO_IMAGE, sample.time, self._tick, predicted[0], features=noisy)
                )
        self._tick += 1
        delay = self._twin.latency - 1e-9
        if self._pending and sample.time >= self._pending[0].captured_at + delay:
            return self._pending.popleft()
        return None


def update_from_features(loop: HysteresisReduction, frame: Frame) -> Report:
    """Pass the features of a frame to the loop; features that are all NaN mean no marker."""
    assert isinstance(frame, FeatureFrame)
    is_lost = np.isnan(frame.features).all()
    return loop.on_features(None if is_lost else frame.features, frame.captured_at)
