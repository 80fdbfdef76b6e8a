"""Solver: parameters and the state of every image, from features and motor positions."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tautscope.calibration.geometry.model import FEATURE_STD, Model
from tautscope.calibration.geometry.parameters import INDEX, RESULTS, SECTION_SHAPE_STD
from tautscope.loop.kinematics import Floats

TOLERANCE = 0.02
"""Largest last step of a parameter, in its standard deviations."""
BLOCK = 2.0
"""Images within this time are not independent [s]."""
_ITERATIONS = 25
_DEGREES = 4.0
"""Where the soft-L1 loss leaves the quadratic, squared."""
_LARGEST_STEP = 2.0
_FREE = 1e-6
"""Weight of the expected tip where the states are free."""


@dataclass(frozen=True, eq=False)
class Solution:
    """Parameters, in standard deviations of their priors, with their uncertainty.

    Attributes:
        z: Parameters.
        covariance: (parameters, parameters), robust against errors that last up to `BLOCK`, with
            `SECTION_SHAPE_STD`.
        states: (images, 4) most probable state and unevenness of each image.
        residuals: (images, 4) measured minus predicted features [px]; NaN where not visible.
        expected: (images, 4) states that the motors let expect.
        last_step: Largest part of the last step of the `RESULTS`, in standard deviations. The
            other parameters may never rest: the derivative of a play by its width jumps where an
            image begins to be in contact.
    """

    z: Floats
    covariance: Floats
    states: Floats
    residuals: Floats
    expected: Floats
    last_step: float


@dataclass(frozen=True, eq=False)
class _Images:
    """The images at their most probable states: weights of the features and of the expectation."""

    states: Floats
    weights: Floats
    state_weights: Floats


def solve(
    model: Model,
    active: NDArray[np.bool_],
    start: Floats | None = None,
    *,
    free_states: bool = False,
) -> Solution:
    """Estimate the parameters by generalised least squares with the states eliminated.

    With the residual of an image about its most probable state x, the features' covariance R and
    the covariance P of the state about its expectation m(theta),

        r = s - h(x; theta) + J (x - m(theta)),      V = R + J P J'
        sum_k G_k' V_k^-1 r_k - theta / prior = 0,   G = dh/dtheta + J dm/dtheta

    G and V are evaluated at a state without the unevenness of the single image: with it, they would
    depend on the noise of the features, and the most probable lengths would be wrong by half
    (decision 0041). Features and states have soft-L1 weights.

    Args:
        model: Model of the record.
        active: Which parameters are estimated.
        start: First parameters.
        free_states: Do not use the expected tip: geometry from the images alone.
    """
    z = np.zeros(len(active)) if start is None else start.copy()
    states, damping, last = model.expected(z), 1.0, np.inf
    pick = np.ix_(active, active)
    for _ in range(_ITERATIONS):
        images = _most_probable(model, z, states, free_states)
        states = images.states
        information, scores = _equations(model, z, images, active)
        step, std = np.zeros(len(z)), np.ones(len(z))
        step[active] = np.linalg.solve(information[pick], (scores.sum(axis=0) - z)[active])
        std[active] = np.sqrt(np.diag(np.linalg.inv(information[pick])))
        sizes = np.abs(step) / std
        size = float(sizes.max())
        # Weights that alternate would repeat for ever.
        damping = damping if size < 0.9 * last else max(damping / 2, 0.1)
        last = size
        z = z + step * damping * min(1.0, _LARGEST_STEP / max(float(np.abs(step).max()), 1e-12))
        if size < TOLERANCE:
            break
    images = _most_probable(model, z, states, free_states)
    information, scores = _equations(model, z, images, active)
    last_step = float(sizes[RESULTS].max())
    covariance = np.zeros_like(information)
    covariance[pick] = _covariance(information[pick], scores[:, active], model.data.captured_at)
    section, slope = INDEX["instrument.bending_length"], INDEX["unevenness over bending"]
    least, per_slope = SECTION_SHAPE_STD
    shape_std = np.hypot(least, per_slope * z[slope] * model.prior_std[slope])
    covariance[section, section] += (shape_std / model.prior_std[section]) ** 2
    residuals = model.data.features - model.features(z, images.states)[0]
    return Solution(z, covariance, images.states, residuals, model.expected(z), last_step)


def _most_probable(model: Model, z: Floats, states: Floats, free_states: bool) -> _Images:
    """Two Gauss-Newton steps of each image's state, with new weights."""
    expected = model.expected(z)
    bound = 3 * model.state_std
    for _ in range(2):
        residuals, jacobian = _whitened(model, z, states)
        weights = _soft_l1(residuals)
        from_expected = (states - expected) / model.state_std
        state_weights = _soft_l1(from_expected)
        if free_states:
            state_weights[:, :3] = _FREE
        transposed = (jacobian * weights[:, :, None]).transpose(0, 2, 1)
        prior = (state_weights / model.state_std**2)[:, None, :] * np.eye(4)
        gradient = np.einsum("nij,nj->ni", transposed, residuals)
        gradient -= state_weights * from_expected / model.state_std
        step = np.linalg.solve(transposed @ jacobian + prior, gradient[:, :, None])[:, :, 0]
        step /= np.maximum(np.abs(step / bound).max(axis=1), 1.0)[:, None]
        states = states + step
    return _Images(states, weights, state_weights)


def _equations(
    model: Model, z: Floats, images: _Images, active: NDArray[np.bool_]
) -> tuple[Floats, Floats]:
    """Information (parameters, parameters) with the prior, and each image's score (images, ...)."""
    states = images.states
    residuals, jacobian = _whitened(model, z, states)
    about = np.column_stack([states[:, :3], np.zeros(model.count)])
    _, at = _whitened(model, z, about)
    by_parameters = np.nan_to_num(model.by_parameters(z, about, active)) / FEATURE_STD
    residuals = residuals + np.einsum("nij,nj->ni", jacobian, states - model.expected(z))
    spread = model.state_std**2 / images.state_weights
    covariance = (at * spread[:, None, :]) @ at.transpose(0, 2, 1)
    covariance += (1 / images.weights)[:, None, :] * np.eye(4)
    solved = np.linalg.solve(
        covariance, np.concatenate([by_parameters, residuals[:, :, None]], axis=2)
    )
    information = np.tensordot(by_parameters, solved[:, :, :-1], ((0, 1), (0, 1)))
    scores = np.einsum("nij,ni->nj", by_parameters, solved[:, :, -1])
    return information + np.eye(len(z)), scores


def _covariance(information: Floats, scores: Floats, captured_at: Floats) -> Floats:
    """Covariance of the estimate, with scores that are correlated within blocks (sandwich)."""
    blocks = ((captured_at - captured_at[0]) // BLOCK).astype(int)
    sums = np.zeros((blocks.max() + 1, scores.shape[1]))
    np.add.at(sums, blocks, scores)
    inverse = np.linalg.inv(information)
    robust = inverse @ (sums.T @ sums + np.eye(len(inverse))) @ inverse
    # With few blocks the robust one may be too small in some directions.
    scale = np.sqrt(np.maximum(np.diag(inverse) / np.diag(robust), 1.0))
    return np.asarray(robust * np.outer(scale, scale))


def _whitened(model: Model, z: Floats, states: Floats) -> tuple[Floats, Floats]:
    """Residuals (n, 4) and Jacobians (n, 4, 4) by the states over the features' std.

    0 where a band is not visible.
    """
    predicted, by_state = model.features(z, states)
    residuals = (model.data.features - predicted) / FEATURE_STD
    is_bad = ~(np.isfinite(residuals).all(axis=1) & np.isfinite(by_state).all(axis=(1, 2)))
    residuals[is_bad], by_state[is_bad] = 0.0, 0.0
    return residuals, by_state / FEATURE_STD


def _soft_l1(residuals: Floats) -> Floats:
    return np.asarray(1 / np.sqrt(1 + residuals**2 / _DEGREES))
