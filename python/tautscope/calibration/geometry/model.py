"""Model of a calibration record: features of a state, and the state that the motors let expect."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from tautscope import _core
from tautscope.calibration.geometry import parameters
from tautscope.calibration.geometry.parameters import IMAGE, INDEX, PARAMETERS
from tautscope.calibration.geometry.recording import Recording
from tautscope.config import Config
from tautscope.dof import Dof
from tautscope.loop.construction import build_feature_model
from tautscope.loop.kinematics import Floats

FEATURE_STD = 0.5
"""Standard deviation of a feature, with what the model does not describe [px]."""
TIP_STD = np.array([0.04, 0.08, 0.04])
"""Standard deviations (3,) of the tip about its expectation, as shares of `safety.width_limit`."""
UNEVENNESS_STD = 0.2
"""Standard deviation of the unevenness of an image's section about its line over the bending."""
_HALF_WIDTH = 0.375
"""Median of the prior of a half width, as a share of `safety.width_limit`."""
_SHARED = 1.4
"""Median of the prior of the logit of the share of friction that the shaft has in common."""
_TICK = 0.02
"""Motor positions are interpolated straight over this time [s]."""
_SCALE = INDEX["gain insertion"]
_STEP = 1e-3
"""Step of the numerical derivatives, in standard deviations of the prior."""


class Model:
    """The features of each image and the expectation of its tip, with their derivatives.

    With the state x = (q, nu) of an image, q [m, rad, rad] and nu the unevenness of its section
    besides that of the parameters theta,

        s = h(q, e0 + e1 (q3 - centre) + nu; theta)          the core's feature model
        q ~ c0 + g ((1 - a) Play(c) + a c - c0) + zero,   at the capture time less delay and lags

    with the core's vector play of insertion and rotation, and c0 the first position of the motors.
    The elastic share a of insertion is the slope of the tip within the play, where a channel gives
    way under a shaft that sticks to it; for rotation and bending, a = 0.

    Args:
        config: The configuration that the parameters are differences from.
        data: The record; all of its images are used.
        band_distance: Measured distance of the bands [m], or None.
    """

    def __init__(self, config: Config, data: Recording, band_distance: float | None) -> None:
        step = max(int(_TICK / np.median(np.diff(data.time)) + 0.5), 1)
        self.data = replace(data, time=data.time[::step], motors=data.motors[::step])
        self.count = len(data.captured_at)
        self.config, self.band_distance = config, band_distance
        self.prior_std = parameters.prior_std(by_band_distance=band_distance is not None)
        self.is_scale_of_drive = band_distance is None
        self._radius = config.instrument.diameter / 2
        self.width_limit = np.array(config.safety.width_limit)
        self._centre = config.experiment.bending.centre
        self.state_std = np.append(TIP_STD * self.width_limit, UNEVENNESS_STD)

    def configured(self, z: Floats) -> Config:
        """The configuration for parameters z in standard deviations of their priors."""
        return parameters.configured(self.config, self.band_distance, z * self.prior_std)

    def features(self, z: Floats, states: Floats) -> tuple[Floats, Floats]:
        """Features (n, 4) and their derivatives (n, 4, 4) by the states (n, 4).

        NaN where a band is not visible.
        """
        slope = (z * self.prior_std)[INDEX["unevenness over bending"]]
        model, unevenness = build_feature_model(self.configured(z)), self._unevenness(z, states)
        predicted, by_q = model.predict_all(states[:, :3], unevenness)
        ahead, _ = model.predict_all(states[:, :3], unevenness + _STEP)
        behind, _ = model.predict_all(states[:, :3], unevenness - _STEP)
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
        shared = float(1 / (1 + np.exp(-_SHARED - value[INDEX["shared friction"]])))
        data = self.data
        tip = _core.Hysteresis(
            half_width=half_width, centre=(0.0, 0.0, 0.0), shared=shared, radius=self._radius
        ).run(data.motors)
        elastic = self.elastic_share(z)
        tip[:, 0] = (1 - elastic) * tip[:, 0] + elastic * data.motors[:, 0]
        lags = value[INDEX["camera.source.delay"]] + parameters.TYPICAL_LAG * np.exp(of("lag"))
        at = [np.interp(data.captured_at - lags[dof], data.time, tip[:, dof]) for dof in Dof]
        start = data.motors[0]
        states = start + np.exp(of("gain")) * (np.stack(at, axis=1) - start) + of("zero")
        return np.column_stack([states, np.zeros(self.count)])

    def elastic_share(self, z: Floats) -> float:
        """Share of insertion's travel that the tip follows within its play."""
        log = (z * self.prior_std)[INDEX["elastic share insertion"]]
        share = parameters.TYPICAL_ELASTIC_SHARE * float(np.exp(log))
        return min(share, parameters.LARGEST_ELASTIC_SHARE)

    def by_parameters(self, z: Floats, states: Floats, active: NDArray[np.bool_]) -> Floats:
        """Derivatives (n, 4, parameters) of the features by z, with the states at `states`.

        Parameters of the motion act through the expected state. NaN where a band is not visible.

        Where the drive is the scale, the derivative by the gain of insertion is taken at `states`,
        not at the expected ones: then one factor of all lengths and of this gain changes no
        feature, as in an image. Otherwise the lengths would be estimated too short, because that
        makes the deviations shorter (decision 0049).
        """
        result = np.zeros((self.count, 4, len(PARAMETERS)))
        _, by_state = self.features(z, states)
        for index in np.flatnonzero(active):
            step = np.zeros(len(z))
            step[index] = _STEP
            if IMAGE.start <= index < IMAGE.stop:
                ahead, behind = (self._features_alone(z + way, states) for way in (step, -step))
                result[:, :, index] = (ahead - behind) / (2 * _STEP)
            elif index == _SCALE and self.is_scale_of_drive:
                travel = (states[:, 0] - self.data.motors[0, 0]) * self.prior_std[index]
                result[:, :, index] = by_state[:, :, Dof.INSERTION] * travel[:, None]
            else:
                by_step = (self.expected(z + step) - self.expected(z - step)) / (2 * _STEP)
                result[:, :, index] = np.einsum("nij,nj->ni", by_state, by_step)
        return result

    def _features_alone(self, z: Floats, states: Floats) -> Floats:
        unevenness = self._unevenness(z, states)
        return build_feature_model(self.configured(z)).predict_all(states[:, :3], unevenness)[0]

    def _unevenness(self, z: Floats, states: Floats) -> Floats:
        value = z * self.prior_std
        constant, slope = value[INDEX["unevenness"]], value[INDEX["unevenness over bending"]]
        return np.asarray(constant + slope * (states[:, 2] - self._centre) + states[:, 3])
