"""Weighted mixture of models: profile ``best``'s filter, other models of hysteresis, and none."""

from collections import defaultdict
from itertools import pairwise

import numpy as np

from tautscope.analysis.models import last_tip, online
from tautscope.analysis.models.components import (
    Component,
    Signals,
    adaptive_operator,
    refitted_models,
)
from tautscope.analysis.models.task import Floats, Prediction, Task, fit_line

MEMORIES = (0.8, 0.9, 0.95, 0.98, 0.995)
"""Discounts of past squared errors, per measured tip: memories of 5 to 200 tips."""
SECOND_MEMORY = 0.9
"""Discount by which the mixtures of all memories are weighted."""
BLOCK = 1024
"""Tips that are weighted at a time, which bounds the memory."""
FLOOR = 1e-3
"""Least error that is told from none, as a share of the tip's range."""


def run(task: Task) -> Prediction:
    """Predict the second half by the mixture; the traces are the weights of its components."""
    command, measured = task.first_half
    slope, _ = fit_line(command, measured, task.gain)
    with_tip = measured[np.isfinite(measured)]
    span, unit = float(np.ptp(command)), float(np.ptp(with_tip)) * (-1 if slope < 0 else 1)
    middle, zero = float(command.min() + command.max()) / 2, float(with_tip.mean())
    signals = Signals((task.command - middle) / span, (task.measured - zero) / unit)
    trivial = np.column_stack([last_tip.last_tip(task, gain) for gain in (0, last_tip.gain(task))])
    scale, estimated, _, _ = online.run_estimator(task, online.fixed_plays)
    components = [
        Component("last_tip", (trivial - zero) / unit),
        Component("fixed_plays", (estimated[:, None] - zero) / unit),
        *refitted_models(signals),
        adaptive_operator(signals),
    ]
    predicted, weights = mix(components, signals)
    tip = zero + unit * predicted
    tip[: task.half] = np.nan
    parameters = {
        "gain": scale.gain,
        "weights": {name: float(trace[-1]) for name, trace in weights.items()},
    }
    traces = {f"weight_{name}": trace for name, trace in weights.items()}
    return Prediction(tip, parameters, traces)


def mix(components: list[Component], signals: Signals) -> tuple[Floats, dict[str, Floats]]:
    """Predict the tip by components, weighted by their past errors.

        w_i ~ L_i^(-N/2),   L_i = sum_j b^j (e_ij^2 + FLOOR^2),   N = sum_j b^j

    e_ij is the error of prediction i at the tip j tips ago. w is the posterior probability of i for
    normally distributed errors of unknown variance (improper prior 1 / variance) and equal prior
    probabilities; b discounts the past. There is such a mixture per b in `MEMORIES`; these are
    weighted by the same formula.

    Args:
        components: Their predictions are used where they are finite; before, the last tip.
        signals: The record; a prediction uses the tips before it.

    Returns:
        Predicted tip (n,), and weight (n,) of each component by name; NaN before the second tip.
    """
    stacked = np.column_stack([component.predicted for component in components])
    variants = np.where(np.isfinite(stacked), stacked, stacked[:, :1])
    ends = np.cumsum([component.predicted.shape[1] for component in components])
    tips = signals.measured[signals.at]
    errors = np.nan_to_num(variants[signals.at] - tips[:, None])
    fits = defaultdict(list)
    for component, end in zip(components, ends, strict=True):
        for refit in component.refits:
            fits[refit.count].append((slice(end - refit.errors.shape[1], end), refit))
    discounts = np.array(MEMORIES)
    # Discounted sums of squared errors, and in the last column their number, per memory.
    sums, second = np.zeros((len(MEMORIES), errors.shape[1] + 1)), np.zeros((1, len(MEMORIES) + 1))
    weights = np.full((1, len(MEMORIES), errors.shape[1]), 1 / errors.shape[1])
    samples = len(signals.command)
    predicted, shares = np.full(samples, np.nan), np.full((samples, len(components)), np.nan)
    # From 1 on: nothing predicts the first tip.
    bounds = {1, *fits, *range(BLOCK, len(tips), BLOCK), len(tips)}
    for begin, end in pairwise(sorted(bounds)):
        block = errors[begin:end].copy()
        found = _discounted(_terms(block), discounts, sums)
        for columns, refit in fits.get(end, []):
            errors[:end, columns] = refit.errors
            forgotten = max(1, refit.forgotten)
            past = discounts[:, None] ** np.arange(end - 1 - forgotten, -1, -1.0)
            found[-1] = past @ _terms(errors[forgotten:end])
        before = weights[-1:]
        weights = _weights(found)
        before = np.concatenate([before, weights[:-1]])
        mixed = _terms(np.einsum("jbi,ji->jb", before, block))
        both = _discounted(mixed, np.array([SECOND_MEMORY]), second)
        total = np.einsum("jb,jbi->ji", _weights(both)[:, 0], weights)
        sums, second = found[-1], both[-1]
        first = signals.at[begin] + 1
        last = signals.at[end] + 1 if end < len(tips) else samples
        lengths = np.diff(signals.at[begin:end] + 1, append=last)
        shown = np.repeat(total, lengths, axis=0)
        predicted[first:last] = np.einsum("ki,ki->k", variants[first:last], shown)
        shares[first:last] = np.add.reduceat(shown, np.concatenate([[0], ends[:-1]]), axis=1)
    names = [component.name for component in components]
    return predicted, dict(zip(names, shares.T, strict=True))


def _terms(errors: Floats) -> Floats:
    """Summands of L and, in the last column, of N: (j, i + 1) for errors (j, i)."""
    return np.column_stack([errors**2 + FLOOR**2, np.ones(len(errors))])


def _discounted(terms: Floats, discounts: Floats, past: Floats) -> Floats:
    """Discounted sums (j, b, i) of terms (j, i) up to each, for sums (b, i) before the first."""
    from scipy.signal import lfilter  # noqa: PLC0415

    found = [
        lfilter([1.0], [1.0, -b], terms, axis=0, zi=b * own[None])[0]
        for b, own in zip(discounts, past, strict=True)
    ]
    return np.stack(found, axis=1)


def _weights(sums: Floats) -> Floats:
    """Posterior probabilities (j, b, i) for sums (j, b, i + 1), relative to the largest."""
    logarithm = -sums[..., -1:] / 2 * np.log(sums[..., :-1])
    weight = np.exp(logarithm - logarithm.max(axis=-1, keepdims=True))
    return np.asarray(weight / weight.sum(axis=-1, keepdims=True))
