"""Calibration records of simulated rigs that differ from their configuration."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from common.small_images import full_size, with_small_images
from numpy.typing import NDArray
from tautscope.calibration.geometry import Recording, sweep
from tautscope.calibration.motion import sweep_motion
from tautscope.config import Config, load_config
from tautscope.loop.rig import Frame
from tautscope.twin import Twin
from tautscope.twin.drawn_rig import draw_geometry

Floats = NDArray[np.float64]
Instrument = Literal["nominal", "uneven curvature", "distributed play", "gains 0.7"]
INSTRUMENTS: tuple[Instrument, ...] = (
    "nominal",
    "uneven curvature",
    "distributed play",
    "gains 0.7",
)
NOISE = 0.5
"""Standard deviation of features in place of images [px]."""
LEAST_VISIBLE = 0.8
"""A band is measured if at least this share of it is visible."""
IMAGE_PERIOD = 0.08
_PROPERTIES: dict[Instrument, dict[str, object]] = {
    "nominal": {},
    "uneven curvature": {"twin.cables.curvature": (0.5, 0.3)},
    "distributed play": {
        "twin.shaft.liner_stiffness": 0.25,
        "twin.cables.joint_spread": 0.3,
    },
    "gains 0.7": {"twin.transmission.gain": (0.7, 0.7, 0.7)},
}


@dataclass(frozen=True)
class Case:
    """A rig, and what its configuration says.

    Attributes:
        seed: Of the instrument, of its errors and of the noise.
        instrument: Its kind.
        images: Whether the bands are found in images; otherwise true features with noise.
    """

    seed: int
    instrument: Instrument = "nominal"
    images: bool = False

    @property
    def told(self) -> Config:
        """The configuration before the calibration."""
        return load_config()

    @property
    def actual(self) -> Config:
        """The configuration of the twin."""
        config = draw_geometry(self.told, self.seed)
        changes = dict(_PROPERTIES[self.instrument])
        if (share := changes.get("twin.shaft.liner_stiffness")) is not None:
            liner = config.twin.shaft.liner_stiffness
            changes["twin.shaft.liner_stiffness"] = tuple(float(share) * each for each in liner)  # type: ignore[arg-type]
        return config.replace(**changes)

    def record(self) -> Recording:
        """Simulate the calibration motion."""
        if not self.images:
            return _feature_record(self)
        rig = Twin(self.actual)
        try:
            return sweep(rig, self.told)
        finally:
            rig.close()


def noisy_features(frame: Frame, noise: float, random: np.random.Generator) -> Floats:
    """True features (4,) of an image of `with_small_images`, with noise; NaN: not visible."""
    assert frame.true_features is not None and frame.true_visible is not None
    features = full_size(frame.true_features) + noise * random.standard_normal(4)
    features[np.repeat(frame.true_visible < LEAST_VISIBLE, 2)] = np.nan
    return np.asarray(features)


def _feature_record(case: Case) -> Recording:
    ticks, images = [], []
    random, due = np.random.default_rng([case.seed, 1]), -np.inf
    rig, reference = Twin(with_small_images(case.actual)), sweep_motion(case.told)
    sample = rig.reset()
    while sample.time < reference.duration:
        ticks.append((sample.time, sample.applied))
        if (frame := sample.frame) is not None and frame.captured_at >= due:
            due = frame.captured_at + IMAGE_PERIOD - 1e-9
            features = noisy_features(frame, NOISE, random)
            if np.isnan(features).any():
                features[:] = np.nan
            images.append((frame.captured_at, features))
        sample = rig.step(reference(sample.time))
    rig.close()
    times, motors = zip(*ticks, strict=True)
    captured_at, features = zip(*images, strict=True)
    return Recording(np.array(times), np.array(motors), np.array(captured_at), np.array(features))


def contradictory(recording: Recording, config: Config) -> Iterator[tuple[str, Recording]]:
    """Records that the model cannot explain, from features of a good one."""
    width, features, motors = config.camera.width, recording.features, recording.motors
    mirrored = features * np.array([-1, 1, -1, 1]) + np.array([width - 1, 0, width - 1, 0])
    yield "mirrored image", replace(recording, features=mirrored)
    yield "bands exchanged", replace(recording, features=features[:, [2, 3, 0, 1]])
    # In the range of the other motor, as after a mix-up of two cables.
    middle, half = motors.mean(axis=0), np.ptp(motors, axis=0) / 2
    for name, order in (
        ("insertion and rotation exchanged", [1, 0, 2]),
        ("rotation and bending exchanged", [0, 2, 1]),
    ):
        scaled = middle + half * ((motors - middle) / half)[:, order]
        yield name, replace(recording, motors=scaled)
