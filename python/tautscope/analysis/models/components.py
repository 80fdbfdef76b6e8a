"""Components of the weighted mixture: predictions of the tip by different models of a record.

All quantities are normalised: the command's range in the first half is 1 with 0 in its middle, the
tip's is 1 with 0 at its mean, and its direction is that of the command.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from tautscope._core import track_coefficients
from tautscope.analysis.models import constant_play, prandtl_ishlinskii
from tautscope.analysis.models.task import Floats, continued, fit_samples

RADII = 0.5 * (np.arange(12) / 12) ** 1.5
"""Radii of the plays; small ones are closer to each other."""
KNOTS = (-0.25, 0.0, 0.25)
"""Where the generalised operator bends the output of every second play."""
SPREAD, REFIT_SPREAD = 0.2, 0.1
"""Prior standard deviation of a coefficient: of plays and their bent outputs, more of them than few
tips determine; and of the scale of a fitted model."""
WALKS = np.array([(d, w) for d in (0.003, 0.03, 0.3) for w in (0.0, 0.1)])
REFIT_WALKS = np.array([(d, 0.0) for d in (0.003, 0.01, 0.03, 0.1, 0.3)])
"""Random walks of disturbance and coefficients, see `track`."""
NOISE, UNKNOWN = 1e-3, 10.0
"""Standard deviation of a measured tip, and prior one of the disturbance."""
FIRST_FIT, GROWTH = 8, 1.25
"""Measured tips of the first fit, and factor to the next."""
Fitted = constant_play.ConstantPlay | prandtl_ishlinskii.PrandtlIshlinskii


@dataclass(frozen=True, eq=False)
class Refit:
    """Errors of a component over past tips, computed anew after a fit.

    Attributes:
        count: Number of tips of the fit, which are also those of `errors`.
        forgotten: The first tips, at which motion before the record still has an effect.
        errors: (count, k) predicted minus measured, scaled for the parameters fitted to them.
    """

    count: int
    forgotten: int
    errors: Floats


@dataclass(frozen=True, eq=False)
class Component:
    """Predictions by variants of one model.

    Attributes:
        name: Name in files and JSON.
        predicted: (n, k) tip; sample j uses the tips measured before j. NaN without a prediction.
        refits: In the order of time.
    """

    name: str
    predicted: Floats
    refits: list[Refit] = field(default_factory=list)


@dataclass(frozen=True, eq=False)
class Signals:
    """Normalised signals of a record.

    Attributes:
        command: (n,).
        measured: (n,) tip, NaN where it was not measured.
    """

    command: Floats
    measured: Floats

    @cached_property
    def at(self) -> NDArray[np.intp]:
        """(s,) the samples with a measured tip."""
        return np.flatnonzero(np.isfinite(self.measured))

    @cached_property
    def travel(self) -> Floats:
        """(n,) travel of the command since the start."""
        return np.cumsum(np.abs(np.diff(self.command, prepend=self.command[0])))


def adaptive_operator(signals: Signals) -> Component:
    """Generalised Prandtl-Ishlinskii operator whose weights are tracked on-line.

    The weights are those of the plays P_i and of max(P_i - knot, 0), which bend the output of a
    play, so that gain and slack may depend on position.
    """
    plain = prandtl_ishlinskii.operators(signals.command, tuple(RADII.tolist()))
    bent = [np.maximum(plain[:, ::2] - knot, 0) for knot in KNOTS]
    features = np.column_stack([plain, *bent])
    predicted = track(features, signals.travel, signals.measured, spread=SPREAD, walks=WALKS)
    return Component("adaptive_bent_plays", predicted)


def refitted_models(signals: Signals) -> Iterator[Component]:
    """A constant play and a Prandtl-Ishlinskii operator, fitted to all past tips ever again."""
    yield _refitted("refitted_play", signals, constant_play.fit)
    yield _refitted("refitted_prandtl_ishlinskii", signals, prandtl_ishlinskii.fit)


def _parameters(model: Fitted) -> int:
    """Number of parameters that were fitted; weights of 0 do not count."""
    if isinstance(model, constant_play.ConstantPlay):
        return 4
    return 1 + sum(weight > 0 for weight in model.weights)


def _refitted(name: str, signals: Signals, fit: Callable[[Floats, Floats], Fitted]) -> Component:
    """A model that is fitted to all tips so far whenever their number has grown by `GROWTH`.

    Variants: its output; its output with a scale and a disturbance that are tracked; and its change
    since the last tip. At a fit, the errors over past tips become those of the new parameters.
    They are optimistic, so they are scaled by Akaike's final prediction error (1969),
    sqrt((N + p) / (N - p)) for p parameters fitted to N tips.
    """
    command, measured, at = signals.command, signals.measured, signals.at
    variants = 2 + len(REFIT_WALKS)
    predicted = np.full((len(command), variants), np.nan)
    refits: list[Refit] = []
    count = FIRST_FIT
    while count < len(at):
        following = int(np.ceil(GROWTH * count))
        begin = at[count - 1] + 1
        end = at[following - 1] + 1 if following < len(at) else len(command)
        past = command[:begin]
        model = fit(past, measured[:begin])
        parameters = _parameters(model)
        output = model.predict(command[:end])
        centred, travel = output - output[:begin].mean(), signals.travel[:end]
        tips = measured[:end]
        tracked = track(centred[:, None], travel, tips, spread=REFIT_SPREAD, walks=REFIT_WALKS)
        found = np.column_stack([output, tracked, continued(output, tips)])
        predicted[begin:end] = found[begin:end]
        forgotten = int(np.argmax(fit_samples(past, measured[:begin])[at[:count]]))
        used = count - forgotten
        inflation = (used + parameters) / (used - parameters) if used > parameters + 2 else 9.0
        errors = found[at[:count]] - measured[at[:count]][:, None]
        refits.append(Refit(count, forgotten, np.nan_to_num(errors) * np.sqrt(inflation)))
        count = following
    return Component(name, predicted, refits)


def track(
    features: Floats, travel: Floats, tips: Floats, *, spread: float, walks: Floats
) -> Floats:
    """Predict the tip by linear regressions whose coefficients Kalman filters track.

        y_k = f_k^T w_k + d_k + v_k,   v_k ~ N(0, NOISE^2)
        w, d: random walks in the travel of the command

    f are the features, w their coefficients, d the disturbance: what the features do not explain.

    Args:
        features: (n, m).
        travel: (n,) travel of the command since the start.
        tips: (n,) the tip, NaN where it was not measured.
        spread: Prior standard deviation of each coefficient; the prior mean of the first is 1, that
            of the others 0.
        walks: (k, 2) standard deviation after a travel of 1 of disturbance and coefficients, the
            latter as a share of `spread`; one row per filter.

    Returns:
        (n, k) predicted tip; NaN up to the first measured tip. Sample j uses the tips before j.
    """
    samples, size = features.shape
    coefficients = (walks[:, 1:] * spread) ** 2
    return track_coefficients(
        np.column_stack([features, np.ones(samples)]),
        travel,
        tips,
        mean=np.arange(size + 1) == 0,
        variance=np.append(np.full(size, spread**2), UNKNOWN**2),
        growth=np.column_stack([np.repeat(coefficients, size, axis=1), walks[:, :1] ** 2]),
        noise=NOISE,
    )
