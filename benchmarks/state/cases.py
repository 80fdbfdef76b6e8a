"""Cases of the state estimation benchmark, and the errors of every estimator in them."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from hysteresis.scenarios import INCOMMENSURATE
from hysteresis.simulation import Sines
from numpy.typing import NDArray
from tautscope import _core
from tautscope.config import Config
from tautscope.dof import Dof
from tautscope.loop import construction
from tautscope.twin.camera import TwinCamera
from tautscope.twin.plant import Plant

Floats = NDArray[np.float64]
TRACKING = (0.5e-3, 0.05, 0.03)
"""Standard deviation of the prediction in operation [m, rad, rad]."""
POSE_TICKS = 23
"""Control periods between two poses."""
DELAY_TICKS = 4
"""Error of the capture time in control periods: 20 ms."""
ARTICLE = "article: one step"
OURS = "best"
VARIANTS: dict[str, dict[str, float]] = {
    "best, exact geometry": {
        "shape_deviation": 0.0,
        "image_deviation": 0.0,
        "misfit_deviation": 0.0,
    },
    "best, no marker rejected": {"outlier_distance": 120.0},
    OURS: {},
}


@dataclass(frozen=True)
class Case:
    """Errors of the measurements and the prediction."""

    name: str
    noise: tuple[float, float] = (0.2, 0.2)
    """Standard deviation of the features of markers A and B [px]."""
    prediction_std: tuple[float, float, float] = TRACKING
    """Standard deviation of the prediction [m, rad, rad]."""
    outliers: float = 0.0
    """Share of the images in which one marker is off by 5 to 40 px."""
    lost: int | None = None
    """Marker that is never visible."""
    is_late: bool = False
    """Whether the prediction is the true state of 20 ms before."""


CASES = (
    Case("clean", noise=(1e-3, 1e-3)),
    Case("noise 0.2 px"),
    Case("noise 0.5 px", noise=(0.5, 0.5)),
    Case("noise 1 px", noise=(1.0, 1.0)),
    Case("noise 0.2 px in A, 1.5 px in B", noise=(0.2, 1.5)),
    Case("prediction off by 2 mm, 0.3, 0.3 rad", prediction_std=(2e-3, 0.3, 0.3)),
    Case("prediction off by 5 mm, 0.5, 0.5 rad", prediction_std=(5e-3, 0.5, 0.5)),
    Case("prediction off by 10 mm, 0.8, 0.8 rad", prediction_std=(10e-3, 0.8, 0.8)),
    Case("outliers in 5 %", outliers=0.05),
    Case("outliers in 10 %", outliers=0.1),
    Case("B not visible", lost=1),
    Case("time wrong by 20 ms", is_late=True),
)


@dataclass(frozen=True)
class Poses:
    """States (n, 3) of one instrument, those of 20 ms before, and features (n, 4)."""

    states: Floats
    earlier: Floats
    features: Floats


def draw_poses(config: Config, count: int) -> Poses:
    """Move the twin, and return its states and features."""
    plant = Plant(config, np.random.default_rng(config.twin.seed))
    camera = TwinCamera(config)
    reference = Sines(config.experiment, INCOMMENSURATE, np.inf)
    states, found = [plant.true_state], []
    for tick in range(1, count * POSE_TICKS + 1):
        plant.step(reference(tick * config.control.period))
        states.append(plant.true_state)
        if tick % POSE_TICKS == 0:
            image = camera.draw(*plant.centreline(), tick)
            found.append((states[-1], states[-1 - DELAY_TICKS], image.true_features))
    kept = [row for row in found if np.isfinite(row[2]).all()]
    return Poses(*(np.array(column) for column in zip(*kept, strict=True)))


@dataclass(frozen=True)
class Errors:
    """Errors (n, 3), errors in standard deviations if these are known, observable (n, 3)."""

    absolute: Floats
    normalised: Floats | None
    observable: NDArray[np.bool_]


def estimate(config: Config, case: Case, poses: Poses) -> dict[str, Errors]:
    """Return the errors of every estimator for the same measurements and predictions."""
    rng = np.random.default_rng([config.twin.seed, CASES.index(case)])
    count = len(poses.states)
    sigma = np.repeat(case.noise, 2)
    measured = poses.features + sigma * rng.standard_normal((count, 4))
    outlier = np.flatnonzero(rng.random(count) < case.outliers)
    angle, distance = rng.uniform(0, 2 * np.pi, outlier.size), rng.uniform(5, 40, outlier.size)
    marker = 2 * rng.integers(0, 2, outlier.size)
    measured[outlier, marker] += distance * np.cos(angle)
    measured[outlier, marker + 1] += distance * np.sin(angle)
    if case.lost is not None:
        measured[:, 2 * case.lost : 2 * case.lost + 2] = np.nan
    predicted = poses.states + np.array(case.prediction_std) * rng.standard_normal((count, 3))
    if case.is_late:
        predicted = poses.earlier
    model = construction.build_feature_model(config)
    found = {}
    states, observable = construction.build_state_estimator(config).run(model, predicted, measured)
    found[ARTICLE] = Errors(states - poses.states, None, observable)
    for name, changes in VARIANTS.items():
        varied = config.replace(
            **{f"estimation.{key}": value for key, value in changes.items()},
            **{f"{dof.label}.start_deviation": case.prediction_std[dof] for dof in Dof},
            **{"safety.off": ["innovation", "swapped"]},
        )
        settings, covariance = construction.core_settings(varied), np.diag(sigma**2)
        rows = [
            first_estimate(settings, prior, features, covariance)
            for prior, features in zip(predicted, measured, strict=True)
        ]
        states, std, seen = (np.array(column) for column in zip(*rows, strict=True))
        errors = states - poses.states
        found[name] = Errors(errors, errors / std, seen)
    return found


def first_estimate(
    settings: dict[str, Any], prior: Floats, measured: Floats, covariance: Floats
) -> tuple[Floats, Floats, NDArray[np.bool_]]:
    """State, its standard deviation and observable DOFs (3,) of the first image of a loop.

    Its prior is the first reference, with the configured `start_deviation`.
    """
    loop = _core.Reduction(settings | {"profile": "best"})
    loop.step(prior, 0.0)
    report = loop.on_features(measured, 0.0, covariance)
    return report[1], report[7], report[5]
