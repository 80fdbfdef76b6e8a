"""Bouc-Wen model in normalised, rate-independent form, fitted by nonlinear least squares."""

from dataclasses import asdict, dataclass

import numpy as np

from tautscope._core import move_along_curve
from tautscope.analysis.models.task import Floats, Prediction, Task, extremes, fit_samples

_LIMIT = 18.0
"""atanh of the largest |w| below 1 in double precision."""
_P = np.linspace(-_LIMIT, _LIMIT, 8193)
_W = np.tanh(_P)
_SLOPE = 1 / np.cosh(_P) ** 2
_ABS_P = np.maximum(np.abs(_P), 1e-12)
_LOG_W = np.log(-np.expm1(-2 * _ABS_P)) - np.log1p(np.exp(-2 * _ABS_P))

_SIGMA, _EXPONENT, _TRAVEL = (0.5, 5.0), (1.0, 20.0), (1.0, 200.0)
"""Bounds of sigma, n, and rho times the command's range."""
_SAMPLES = 5000
"""Of a longer record, at most so many tips and extremes of the command are in the fit."""
_STARTS = (5.0, 15.0, 50.0)
"""Initial values of rho times the command's range; the best fit is taken."""


@dataclass(frozen=True)
class BoucWen:
    """A line plus a hysteretic variable w of the command c.

        tip = gain c + hysteresis w + offset

        dw/dc = rho (1 - s sigma |w|^(n-1) w + (sigma - 1) |w|^n),   s = sign(dc), |w| <= 1

    The equation does not contain time: the model is rate independent.

    Attributes:
        gain: [tip's unit per command's unit].
        hysteresis: Displacement of the tip at w = 1; negative if the tip lags [tip's unit].
        offset: [tip's unit].
        rho: Above 0; 1 / rho is the travel over which w reverses [1 / command's unit].
        sigma: At least 0.5; 1 is symmetric loading and unloading (Dahl's model if n = 1).
        exponent: n, at least 1; a larger one makes a sharper corner.
        start: w before the first command.
    """

    gain: float
    hysteresis: float
    offset: float
    rho: float
    sigma: float
    exponent: float
    start: float

    def predict(self, command: Floats) -> Floats:
        """Tip (n,) for a command (n,)."""
        w = hysteretic_variable(command, self.rho, self.sigma, self.exponent, self.start)
        return self.gain * command + self.hysteresis * w + self.offset


def hysteretic_variable(
    command: Floats, rho: float, sigma: float, exponent: float, start: float
) -> Floats:
    """The w (n,) of `BoucWen` for a command (n,), integrated exactly between its samples.

    While the command rises, w obeys dw/dc = rho f(w) with f = 1 - w^n for w >= 0 and
    f = 1 + (2 sigma - 1) |w|^n below: it moves along one curve, F(w) = integral of dw / f(w),
    at the speed rho. F is tabulated over atanh(w); a falling command is a rising one with the
    sign of w changed. A monotonic segment takes one interpolation, at any sampling.
    """
    log_power = exponent * _LOG_W
    rate = np.where(_P >= 0, -np.expm1(log_power), 1 + (2 * sigma - 1) * np.exp(log_power))
    slope = _SLOPE / rate
    curve = np.concatenate([[0.0], np.cumsum((slope[1:] + slope[:-1]) * (_P[1] - _P[0]) / 2)])
    at = float(np.arctanh(np.clip(start, _W[0], _W[-1])))
    return np.tanh(move_along_curve(command, _P, curve, start=at, rate=rho))


def fit(command: Floats, measured: Floats) -> BoucWen:
    """Fit by least squares.

    `scipy.optimize.least_squares` searches rho, sigma, n and start, from several rho because the
    error has local minima; gain, hysteresis and offset are a linear problem inside.

    Wrong for an ideal play (n without bound), and under tremor of the command, where w drifts.

    Args:
        command: (n,), not constant.
        measured: (n,), NaN where not measured.
    """
    from scipy.optimize import least_squares  # noqa: PLC0415  takes a third of a second

    if len(command) > _SAMPLES:
        seen = np.flatnonzero(np.isfinite(measured))
        turns = extremes(command, -(-2 * len(command) // _SAMPLES))
        kept = np.union1d(seen[:: -(-len(seen) // _SAMPLES)], turns)
        command, measured = command[kept], measured[kept]
    where = fit_samples(command, measured)
    target = measured[where]
    extent = float(np.ptp(command))

    def shape(parameters: Floats) -> tuple[float, float, float, float]:
        log_travel, sigma, exponent, start = parameters.tolist()
        return float(np.exp(log_travel)) / extent, sigma, exponent, start

    def solved(parameters: Floats) -> tuple[Floats, Floats]:
        w = hysteretic_variable(command, *shape(parameters))[where]
        columns = np.column_stack([command[where], w, np.ones(len(w))])
        weights = np.linalg.lstsq(columns, target, rcond=None)[0].astype(np.float64)
        error: Floats = columns @ weights - target
        return weights, error

    low, high = np.array([np.log(_TRAVEL), _SIGMA, _EXPONENT, (-1.0, 1.0)]).T
    fits = [
        least_squares(
            lambda parameters: solved(parameters)[1],
            np.array([np.log(travel), 1.0, 1.5, 0.0]),
            bounds=(low, high),
            diff_step=1e-4,
        )
        for travel in _STARTS
    ]
    best = min(fits, key=lambda fit: float(fit.cost)).x
    gain, hysteresis, offset = solved(best)[0].tolist()
    return BoucWen(gain, hysteresis, offset, *shape(best))


def run(task: Task) -> Prediction:
    """Fit to the first half, and predict; a given gain is not used."""
    found = fit(*task.first_half)
    return Prediction(found.predict(task.command), asdict(found))
