"""Model of a calibration record: features of a state, and the state that the motors let expect."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tautscope import _core
from tautscope.calibration.geometry.parameters import (
    IMAGE,
    INDEX,
    PARAMETERS,
    TYPICAL_LAG,
    TYPICAL_ROUNDING,
    Geometry,
    prior_std,
)
from tautscope.config import Config
from tautscope.dof import Dof

Floats = NDArray[np.float64]
FEATURE_STD = 0.5
"""Standard deviation of a feature before residuals are known [px]."""
TIP_STD = np.array([0.04, 0.08, 0.04])
"""Standard deviations (3,) of the tip about its expectation, as shares of `safety.width_limit`."""
UNEVENNESS_STD = 0.05
"""Standard deviation of the unevenness of an image's section about its line over the bending."""
_HALF_WIDTH = 0.375
"""Median of the prior of a half width, as a share of `safety.width_limit`."""
_SHARED = 1.4
"""Median of the prior of the logit of the share of friction that the shaft has in common."""
_TICK = 0.02
"""Motor positions are interpolated straight over this time [s]."""
_STEP = 1e-3
"""Step of the numerical derivatives, in standard deviations of the prior."""


@dataclass(frozen=True, eq=False)
class Data:
    """The measurements of a fit.

    Attributes:
        time: (n,) [s].
        motors: (n, 3) [m, rad, rad].
        captured_at: (images,) stamped capture times [s].
        features: (images, 4) of images with both bands [px].
    """

    time: Floats
    motors: Floats
    captured_at: Floats
    features: Floats

    def thinned(self) -> Data:
        """The same with motor positions no closer than the model needs."""
        step = max(int(_TICK / np.median(np.diff(self.time)) + 0.5), 1)
        return Data(self.time[::step], self.motors[::step], self.captured_at, self.features)


class Model:
    """The features of each image and the expectation of its tip, with their derivatives.

    With the state x = (q, nu) of an image, q [m, rad, rad] and nu the unevenness of its section
    besides that of the parameters theta,

        s = h(q, e0 + e1 (q3 - centre) + nu; theta)          the core's feature model
        q ~ c0 + g (Play(c) - c0) + zero,   at the capture time less delay and lags

    with the core's vector play of insertion and rotation, and c0 the first position of the motors.

    Args:
        config: The configuration that the parameters are differences from.
        data: The record.
        band_distance: Measured distance of the bands [m], or None.
        feature_std: Standard deviation of a feature [px].
    """

    def __init__(
        self,
        config: Config,
        data: Data,
        band_distance: float | None,
        feature_std: float = FEATURE_STD,
    ) -> None:
        self.feature_std = feature_std
        self.data = data.thinned()
        self.count = len(data.captured_at)
        self._config, self._band_distance = config, band_distance
        self.prior_std = prior_std(by_band_distance=band_distance is not None)
        self._radius = config.instrument.diameter / 2
        self.width_limit = np.array(config.safety.width_limit)
        self._centre = config.experiment.bending.centre
        self.state_std = np.append(TIP_STD * self.width_limit, UNEVENNESS_STD)

    def geometry(self, z: Floats) -> Geometry:
        """Geometry for parameters z in standard deviations of their priors."""
        return Geometry(self._config, self._band_distance, z * self.prior_std)

    def features(self, z: Floats, states: Floats) -> tuple[Floats, Floats]:
        """Features (n, 4) and their derivatives (n, 4, 4) by the states (n, 4).

        NaN where a band is not visible.
        """
        slope = (z * self.prior_std)[INDEX["unevenness over bending"]]
        model = self.geometry(z).feature_model()
        predicted, by_q = model.predict_all(states[:, :3], self._unevenness(z, states))
        shift = np.array([0.0, 0.0, 0.0, _STEP])
        ahead, behind = (
            model.predict_all(states[:, :3], self._unevenness(z, states + sign * shift))[0]
            for sign in (1, -1)
        )
        by_unevenness = (ahead - behind) / (2 * _STEP)
        by_state = np.concatenate([by_q, by_unevenness[:, :, None]], axis=2)
        by_state[:, :, Dof.BENDING] += slope * by_unevenness
        return predicted, by_state

    def expected(self, z: Floats) -> Floats:
        """Expected states (n, 4): the tip of the play model, and an unevenness of 0."""
        value = z * self.prior_std

        def of(name: str) -> Floats:
            return np.array([value[INDEX[f"{name} {dof.label}"]] for dof in Dof])

        half_width = _HALF_WIDTH * self.width_limit * np.exp(of("half width"))
        rounding = min(TYPICAL_ROUNDING * float(np.exp(value[INDEX["rounding"]])), 0.9)
        shared = float(1 / (1 + np.exp(-_SHARED - value[INDEX["shared friction"]])))
        data = self.data
        plays = [
            _core.Hysteresis(
                half_width=share * half_width,
                centre=(0.0, 0.0, 0.0),
                shared=shared,
                radius=self._radius,
            ).run(data.motors)
            for share in (1 - rounding, 1 + rounding)
        ]
        tip = np.mean(plays, axis=0)
        lags = value[INDEX["camera.source.delay"]] + TYPICAL_LAG * np.exp(of("lag"))
        at = [np.interp(data.captured_at - lags[dof], data.time, tip[:, dof]) for dof in Dof]
        start = data.motors[0]
        states = start + np.exp(of("gain")) * (np.stack(at, axis=1) - start) + of("zero")
        return np.column_stack([states, np.zeros(self.count)])

    def by_parameters(self, z: Floats, states: Floats, active: NDArray[np.bool_]) -> Floats:
        """Derivatives (n, 4, parameters) of the features by z, with the states at `states`.

        Parameters of the motion act through the expected state. NaN where a band is not visible.
        """
        result = np.zeros((self.count, 4, len(PARAMETERS)))
        _, by_state = self.features(z, states)
        for index in np.flatnonzero(active):
            step = np.zeros(len(z))
            step[index] = _STEP
            if IMAGE.start <= index < IMAGE.stop:
                ahead, behind = (self._features_alone(z + way, states) for way in (step, -step))
                result[:, :, index] = (ahead - behind) / (2 * _STEP)
            else:
                by_step = (self.expected(z + step) - self.expected(z - step)) / (2 * _STEP)
                result[:, :, index] = np.einsum("nij,nj->ni", by_state, by_step)
        return result

    def _features_alone(self, z: Floats, states: Floats) -> Floats:
        unevenness = self._unevenness(z, states)
        return self.geometry(z).feature_model().predict_all(states[:, :3], unevenness)[0]

    def _unevenness(self, z: Floats, states: Floats) -> Floats:
        value = z * self.prior_std
        constant, slope = value[INDEX["unevenness"]], value[INDEX["unevenness over bending"]]
        return np.asarray(constant + slope * (states[:, 2] - self._centre) + states[:, 3])
