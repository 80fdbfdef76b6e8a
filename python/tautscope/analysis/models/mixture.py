"""Weighted mixture of models: profile ``best``'s filter, other models of hysteresis, and none."""

from __future__ import annotations

from collections import defaultdict

import numpy as np

from tautscope.analysis.models import last_tip, linear_fit, online
from tautscope.analysis.models.components import (
    Component,
    Signals,
    adaptive_operators,
    refitted_models,
)
from tautscope.analysis.models.task import Floats, Prediction, Task

MEMORIES = (0.8, 0.9, 0.95, 0.98, 0.995)
"""Discounts of past squared errors, per measured tip: memories of 5 to 200 tips."""
SECOND_MEMORY = 0.9
"""Discount by which the mixtures of all memories are weighted."""
FLOOR = 1e-3
"""Least error that is told from none, as a share of the tip's range."""


def run(task: Task) -> Prediction:
    """Predict the second half by the mixture; the traces are the weights of its components."""
    command, measured = task.first_half
    slope = linear_fit.fit(command, measured, task.gain).gain
    with_tip = measured[np.isfinite(measured)]
    span, unit = float(np.ptp(command)), float(np.ptp(with_tip)) * (-1 if slope < 0 else 1)
    middle, zero = float(command.min() + command.max()) / 2, float(with_tip.mean())
    signals = Signals((task.command - middle) / span, (task.measured - zero) / unit)
    trivial = np.column_stack([last_tip.last_tip(task, gain) for gain in (0, last_tip.gain(task))])
    scale, estimated, _, _ = online.run_estimator(task, online.ensemble)
    components = [
        Component("last_tip", (trivial - zero) / unit),
        Component("ensemble_filter", (estimated[:, None] - zero) / unit),
        *refitted_models(signals),
        *adaptive_operators(signals),
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
    forgotten = 1  # there is no prediction of the first tip
    losses, counts = np.zeros((len(MEMORIES), errors.shape[1])), np.zeros(len(MEMORIES))
    second, second_count = np.zeros(len(MEMORIES)), 0.0
    weights = np.full((len(MEMORIES), errors.shape[1]), 1 / errors.shape[1])
    samples = len(signals.command)
    predicted, shares = np.full(samples, np.nan), np.full((samples, len(components)), np.nan)
    for j, k in enumerate(signals.at):
        if j < forgotten:
            continue
        second = SECOND_MEMORY * second + (weights @ errors[j]) ** 2 + FLOOR**2
        second_count = SECOND_MEMORY * second_count + 1
        if j + 1 in fits:
            for columns, refit in fits[j + 1]:
                errors[: j + 1, columns] = refit.errors
                forgotten = max(1, refit.forgotten)
            past = discounts[:, None] ** np.arange(j - forgotten, -1, -1.0)
            counts = past.sum(axis=1)
            losses = past @ (errors[forgotten : j + 1] ** 2) + counts[:, None] * FLOOR**2
        else:
            counts = discounts * counts + 1
            losses = discounts[:, None] * losses + errors[j] ** 2 + FLOOR**2
        weights = _weights(losses, counts[:, None])
        total = _weights(second, second_count) @ weights
        until = signals.at[j + 1] + 1 if j + 1 < len(signals.at) else samples
        predicted[k + 1 : until] = variants[k + 1 : until] @ total
        shares[k + 1 : until] = np.add.reduceat(total, np.concatenate([[0], ends[:-1]]))
    names = [component.name for component in components]
    return predicted, dict(zip(names, shares.T, strict=True))


def _weights(losses: Floats, counts: Floats | float) -> Floats:
    """Posterior probabilities along the last axis; computed relative to the largest."""
    logarithm = -counts / 2 * np.log(losses)
    weight = np.exp(logarithm - logarithm.max(axis=-1, keepdims=True))
    return np.asarray(weight / weight.sum(axis=-1, keepdims=True))
