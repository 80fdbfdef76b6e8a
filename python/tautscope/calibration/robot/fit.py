"""Fit of kinematics, zeros, gains and delays to a motion, with hysteresis beside them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from tautscope.calibration.motion import MotionRecord
from tautscope.calibration.robot.model import PLAYS, Model, used_measurements
from tautscope.config import Config
from tautscope.errors import CalibrationError
from tautscope.loop.kinematics import Floats

LEAST = 100
"""Measurements that are needed."""
UNDETERMINED = 0.5
"""Standard deviation, over that of the prior, above which a parameter is not determined."""
LEAST_GAIN = 3.0
"""Gain over its standard deviation below which the tip does not follow a motor."""
LEAST_DEVIATION = 0.1
"""Of a sensor, over the configured one: a sensor without noise is not one without errors."""
WEIGHT_STD = 0.3
"""Of the prior of the weight of a play."""
DEVIATION = 0.05
"""First standard deviation of a state from that of the plays [width_limit]."""
_PASSES = 3
_LEAST_SHARE = 0.05
"""Share of a sensor's noise that the states leave over, below which it is not estimated."""
_BLOCK = 2.0
"""Time over which what the plays do not describe is one error [s]."""
_PREFERRED = 0.7
"""Misfit over that with fewer motors against their degree of freedom, to assume more."""


@dataclass(frozen=True)
class RobotFit:
    """What a motion says of a robot.

    Attributes:
        values: By name: keys of the configuration, and ``dof.NAME.zero``, ``.gain``, ``.slack``
            [SI units]: tip = zero + gain times what the motor does less the slack.
        std: Standard deviations of `values`; not of the slack.
        deviations: Standard deviation of each kind of sensor by its key of [measurement]: its noise
            and what the kinematics does not describe.
        undetermined: Parameters that the motion does not determine.
    """

    values: Mapping[str, float]
    std: Mapping[str, float]
    deviations: Mapping[str, float]
    undetermined: tuple[str, ...]


def fit(record: MotionRecord, config: Config, keep: Sequence[str] = ()) -> RobotFit:
    """Least squares over all measurements, with soft-L1 loss.

    A measurement z of covariance R is at h(q; theta), where the state q is that of the plays,
    m(phi), to a deviation of covariance P; with J = dh/dq, the sum over the components of all

        rho((L^-1 (z - h(m(phi); theta)))_k^2),     L L' = V = R + J P J'.

    P and the standard deviations of the sensors are estimated from the residuals, twice. Standard
    deviations are those of blocks of 2 s whose errors may be one (sandwich estimator), and not
    below those of independent errors. Each parameter has a wide prior, as a residual with the same
    loss; one whose standard deviation remains above half of the prior's is not determined, nor is a
    gain that may be 0.

    Raises:
        CalibrationError: There are too few measurements.
        FieldError: `keep` names no parameter, see `check_keep`.
    """
    count = len(used_measurements(record))
    if count < LEAST:
        what = f"{count} measurements in the motion"
        raise CalibrationError(what, f"Check the sensor, or move for longer: {LEAST} are needed")
    model = Model(record, config, keep)
    p = _first(model)
    limits = np.array([dof.width_limit for dof in config.dof])
    variance = (DEVIATION * limits) ** 2
    fitting = _Fitting(model)
    for number in range(_PASSES):
        fitting.weigh(p, variance)
        p = fitting.solve(p)
        if number < _PASSES - 1:
            variance = fitting.update(p, variance)
    return fitting.result(p)


class _Fitting:
    """The weights of the residuals, and the solver."""

    def __init__(self, model: Model) -> None:
        self._model, parameters = model, model.parameters
        weights = model.half_widths.size
        self._prior = model.start()
        self._std = np.array([*[each.std for each in parameters], *[WEIGHT_STD] * weights])
        self._low = np.array([*[each.low for each in parameters], *[0.0] * weights])
        self._scale = dict.fromkeys(np.unique(model.groups), 1.0)

    def weigh(self, p: Floats, variance: Floats) -> None:
        """Set V at parameters, for variances (n,) of the states' deviations."""
        model = self._model
        by_state = model.by_state(p, model.motion(p)[0])
        noise = np.vectorize(self._scale.get)(model.groups).astype(float)
        self._noise = model.covariance * np.sqrt(noise[:, :, None] * noise[:, None, :])
        deviation = np.einsum("kmn,n,kln->kml", by_state, variance, by_state)
        self._factor = np.linalg.cholesky(self._noise + deviation)

    def solve(self, p: Floats) -> Floats:
        """The most probable parameters."""
        p = np.maximum(p, self._low + 1e-3 * self._std)
        solved = least_squares(
            self._residuals,
            p,
            self._jacobian,
            bounds=(self._low, np.inf),
            loss="soft_l1",
            x_scale=self._std,
            xtol=1e-4,
            ftol=1e-4,
            max_nfev=20,
        )
        return np.asarray(solved.x)

    def update(self, p: Floats, variance: Floats) -> Floats:
        """Variances (n,) of the states' deviations from residuals, and of the sensors' noise."""
        model = self._model
        states = model.motion(p)[0]
        by_state = model.by_state(p, states)
        residuals = model.values - model.predict(p, states)
        inverse = np.linalg.inv(self._noise)
        information = np.einsum("kmn,kml,kls->kns", by_state, inverse, by_state)
        posterior = np.linalg.inv(information + np.diag(1 / variance))
        steps = np.einsum("kns,kms,kml,kl->kn", posterior, by_state, inverse, residuals)
        left = residuals - np.einsum("kmn,kn->km", by_state, steps)
        known = np.einsum("kmn,kns,kms->km", by_state, posterior, by_state)
        noise = np.einsum("kmm->km", self._noise)
        for name in self._scale:
            own = model.is_seen & (model.groups == name)
            share = 1 - np.mean(known[own]) / np.mean(noise[own]) if own.any() else 0.0
            if name and share > _LEAST_SHARE:
                scale = _mean_square(left[own]) / (share * np.mean(noise[own]))
                self._scale[name] = max(scale * self._scale[name], LEAST_DEVIATION**2)
        spread = np.einsum("knn->kn", posterior)
        return np.array([_mean_square(step) for step in steps.T] + np.mean(spread, axis=0))

    def result(self, p: Floats) -> RobotFit:
        """Values, standard deviations and what is not determined."""
        model = self._model
        weights = model.weights_from
        covariance = self._covariance(p)
        std = np.sqrt(np.diag(covariance))
        values = dict(zip(model.names, p.tolist(), strict=False))
        stds = dict(zip(model.names, std.tolist(), strict=False))
        lost = [
            each.name
            for each in model.parameters
            if stds[each.name] > UNDETERMINED * each.std and not each.name.endswith(".lag")
        ]
        for index, dof in enumerate(model.config.dof):
            own = slice(weights + index * PLAYS, weights + (index + 1) * PLAYS)
            name, total = f"dof.{dof.name}.gain", float(p[own].sum())
            values[name] = total * model.signs[index]
            stds[name] = float(np.sqrt(covariance[own, own].sum()))
            is_wide = stds[name] > UNDETERMINED * WEIGHT_STD * np.sqrt(PLAYS)
            # Weights at their bound of 0 have no standard deviation.
            if is_wide or total < LEAST_GAIN * stds[name] or stds[name] == 0:
                lost.append(name)
            widths = 2 * model.half_widths[index]
            values[f"dof.{dof.name}.slack"] = float(p[own] @ widths / max(total, 1e-9))
        settings = model.config.measurement
        deviations = {
            f"measurement.{name}": float(getattr(settings, name) * np.sqrt(scale))
            for name, scale in self._scale.items()
            if scale != 1.0
        }
        return RobotFit(values, stds, deviations, tuple(lost))

    def _residuals(self, p: Floats) -> Floats:
        model = self._model
        differences = model.predict(p, model.motion(p)[0]) - model.values
        own = np.linalg.solve(self._factor, differences[:, :, None])
        return np.concatenate([own.ravel(), (p - self._prior) / self._std])

    def _jacobian(self, p: Floats) -> Floats:
        own = np.linalg.solve(self._factor, self._model.jacobian(p))
        return np.concatenate([own.reshape(-1, len(p)), np.diag(1 / self._std)])

    def _covariance(self, p: Floats) -> Floats:
        """Of independent errors, or of one error per block where that is larger."""
        residuals, rows = self._residuals(p), self._jacobian(p)
        free = p > self._low + 1e-6 * self._std
        rows[:, ~free] = 0.0
        count = self._model.values.size
        slope = 1 / np.sqrt(1 + residuals**2)
        inverse = np.linalg.pinv(np.einsum("ki,k,kj->ij", rows, slope, rows), hermitian=True)
        scores = (rows * (slope * residuals)[:, None])[:count]
        blocks = np.floor(np.repeat(self._model.times, self._model.values.shape[1]) / _BLOCK)
        sums = np.array([scores[blocks == block].sum(axis=0) for block in np.unique(blocks)])
        sandwich = inverse @ (sums.T @ sums) @ inverse
        larger = np.sqrt(np.maximum(np.diag(sandwich) / np.maximum(np.diag(inverse), 1e-300), 1.0))
        return np.asarray(inverse * np.outer(larger, larger))


def _first(model: Model) -> Floats:
    """Start: the signs of the motors, and the base's pose if it is fitted, by Kabsch's method."""
    base = {f"kinematics.base_{of}[{k}]" for of in ("position", "rotation") for k in range(3)}
    noise = np.sqrt(np.einsum("kmm->km", model.covariance))
    best, found = np.inf, model.start()
    trials = sorted(product((1.0, -1.0), repeat=len(model.signs)), key=lambda signs: -sum(signs))
    for signs in trials:
        model.signs = np.array(signs)
        p = model.start()
        if base.issubset(model.names):
            p = _aligned(model, p, model.names.index("kinematics.base_position[0]"))
        left = (model.values - model.predict(p, model.motion(p)[0])) / noise
        misfit = float(np.mean(np.abs(left)))
        if misfit < _PREFERRED * best:
            best, found, chosen = misfit, p, model.signs
    if not np.isfinite(best):
        what = "The kinematics predict no finite tip with any signs of the motors"
        raise CalibrationError(what, "Check the kinematics with the states of the motion")
    model.signs = chosen
    return found


def _aligned(model: Model, p: Floats, first: int) -> Floats:
    """Parameters with the base's pose, from index `first` on, for which positions agree best."""
    own = np.all(model.groups[:, :3] == "position_deviation", axis=1)
    own &= model.is_seen[:, :3].all(axis=1)
    if own.sum() < LEAST / 2:
        return p
    p[first : first + 6] = 0.0
    there, here = model.predict(p, model.motion(p)[0])[own, :3], model.values[own, :3]
    middle, end = there.mean(axis=0), here.mean(axis=0)
    rotation, _ = Rotation.align_vectors(here - end, there - middle)
    p[first : first + 6] = [*(end - rotation.apply(middle)), *rotation.as_rotvec()]
    return p


def _mean_square(values: Floats) -> float:
    """Mean square of normal values, without their outliers."""
    return float((1.4826 * np.median(np.abs(values))) ** 2)
