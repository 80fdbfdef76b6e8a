"""Bound of the reduction of the tracking error: the law with exact knowledge of ideal plays.

It shares no code with the compiled laws, so that tests can compare them with it.
"""

import math

import numpy as np
from numpy.typing import ArrayLike

from tautscope.config import Config, LawConfig
from tautscope.dof import Dof
from tautscope.errors import SignalError
from tautscope.report.metrics import Floats, reduction, tracking_rms
from tautscope.report.rows import ARTICLE

Pair = tuple[float, float]

GAIN_LIMIT = LawConfig().free_gain
"""Largest speed of the command over that of the reference, in half widths."""
TIP_GAIN = 2.0
"""Largest speed of the tip over that of the reference, in half widths."""
MEMORY = 1e-4
"""Travel of the shaft's surface over which a direction of motion is forgotten [m]."""
ITERATIONS = 5
"""Of the two searches in a tick: for the slip, and for the share of a step."""


def tracking_bound(reference: ArrayLike, config: Config, *, first: int = 0) -> Floats:
    """Reduction of the tracking error that `track_ideal_plays` reaches.

    Args:
        reference: u (n, 3) [m, rad, rad], one row per control tick.
        config: Has the radius of the shaft.
        first: First row that counts.

    Returns:
        (3,) 1 - RMS error with the law / RMS error with the reference as command; NaN for a DOF
        without an error.

    Raises:
        SignalError: The reference is not (n, 3).

    Wrong when: the instrument has other widths, or its plays are not ideal. No law is proved to be
    unable to exceed it: one that moves the tip faster than this one tracks better.
    """
    u = np.asarray(reference, dtype=np.float64)
    (_, free), (_, tip) = (
        track_ideal_plays(u, config, compensate=compensate) for compensate in (False, True)
    )
    before, after = (
        [tracking_rms(u[first:, dof], each[first:, dof]) for dof in Dof] for each in (free, tip)
    )
    return np.array([reduction(*pair) for pair in zip(before, after, strict=True)])


def play_bound(reference: ArrayLike, half_width: float, *, first: int = 0) -> float:
    """`tracking_bound` of a DOF by itself.

    Args:
        reference: u (n,) [m or rad], one row per control tick.
        half_width: Of the play [m or rad].
        first: First row that counts.

    Returns:
        1 - RMS error with the law / RMS error with the reference as command.
    """
    u = np.asarray(reference, dtype=np.float64)
    free, tip = (_track_one(u, half_width, compensate)[1] for compensate in (False, True))
    return reduction(*(tracking_rms(u[first:], each[first:]) for each in (free, tip)))


def track_ideal_plays(
    reference: ArrayLike, config: Config, *, compensate: bool = True
) -> tuple[Floats, Floats]:
    """Command and tip of ideal plays under the vector law, with exact knowledge of tip and widths.

    Insertion and rotation are one vector play. With e = c - q, half the uncompensated widths of
    the article's Table 1, h, and the radius r of the shaft,

        n = (e1 / h1, e2 / h2),  |n| <= 1;  where |n| = 1, (dq1, r dq2) = n dl,  dl >= 0

    With the recent direction w of the reference's motion (du1, r du2), forgotten over a travel of
    0.1 mm, the command moves towards

        u + h w / |w|,    |dc / h| <= K_b |du / h|,    |dq / h| <= 2 |du / h|

    with norms over insertion and rotation. Bending is the case of one DOF. At the start c = q = u.

    Args:
        reference: u (n, 3) [m, rad, rad], one row per control tick.
        config: Has the radius of the shaft.
        compensate: If false, the command is the reference.

    Returns:
        Command c and tip q, each (n, 3) [m, rad, rad].

    Raises:
        SignalError: The reference is not (n, 3).
    """
    u = np.asarray(reference, dtype=np.float64)
    if u.ndim != 2 or u.shape[1] != len(Dof):
        raise SignalError("reference", u.shape, "an array of shape (n, 3)")
    h1, h2, h3 = (0.5 * ARTICLE["uncompensated"][dof] for dof in Dof)
    shaft = _track(u[:, :2], (h1, h2), config.instrument.diameter / 2, compensate)
    bending = _track_one(u[:, 2], h3, compensate)
    command, tip = (np.column_stack(both) for both in zip(shaft, bending, strict=True))
    return command, tip


def _track_one(reference: Floats, half: float, compensate: bool) -> tuple[Floats, Floats]:
    """Command (n,) and tip (n,) of a vector play whose second axis never moves."""
    padded = np.column_stack([reference, np.zeros(len(reference))])
    command, tip = _track(padded, (half, 1.0), 1.0, compensate)
    return command[:, 0], tip[:, 0]


def _track(reference: Floats, half: Pair, radius: float, compensate: bool) -> tuple[Floats, Floats]:
    """Command (n, 2) and tip (n, 2) of a vector play."""
    h1, h2 = half
    (u1, u2), *rest = reference.tolist()
    c1, c2, e1, e2, w1, w2 = u1, u2, 0.0, 0.0, 0.0, 0.0
    rows = [(c1, c2, u1, u2)]
    for v1, v2 in rest:
        d1, d2, u1, u2 = v1 - u1, v2 - u2, v1, v2
        moved = math.hypot(d1 / h1, d2 / h2)
        if moved > 0:
            step1, step2 = d1, d2
            if compensate:
                w1, w2 = _forget((w1, w2), (d1, radius * d2))
                length = math.hypot(w1, w2) or 1.0
                step1, step2 = u1 + h1 * w1 / length - c1, u2 + h2 * w2 / length - c2
                ratio = math.hypot(step1 / h1, step2 / h2) / (GAIN_LIMIT * moved)
                step = step1 / max(ratio, 1.0), step2 / max(ratio, 1.0)
                step1, step2 = _limit_tip((e1, e2), step, half, radius, TIP_GAIN * moved)
            c1, c2 = c1 + step1, c2 + step2
            e1, e2 = _slide((e1 + step1, e2 + step2), half, radius)
        rows.append((c1, c2, c1 - e1, c2 - e2))
    signals = np.array(rows)
    return signals[:, :2], signals[:, 2:]


def _forget(direction: Pair, travel: Pair) -> Pair:
    """Recent direction of motion after a further travel of the shaft's surface [m]."""
    length = math.hypot(*travel)
    share = -math.expm1(-length / MEMORY)
    return (
        direction[0] + share * (travel[0] / length - direction[0]),
        direction[1] + share * (travel[1] / length - direction[1]),
    )


def _slide(offset: Pair, half: Pair, radius: float) -> Pair:
    """Offset e after the tip slid, from the one before: (a, b) in half widths.

    The tip slides by dl = h1 l, so that n = (a / (1 + l), b / (1 + k l)) with k = h1 / (r h2). Then
    |n| = 1 determines l; |n| is convex in l, and Newton's method converges from l = 0.
    """
    a, b = offset[0] / half[0], offset[1] / half[1]
    if a * a + b * b <= 1:
        return offset
    ratio, slip = half[0] / (radius * half[1]), 0.0
    for _ in range(ITERATIONS):
        x, y = a / (1 + slip), b / (1 + ratio * slip)
        excess = x * x + y * y - 1
        slip += excess / (2 * (x * x / (1 + slip) + ratio * y * y / (1 + ratio * slip)))
    x, y = a / (1 + slip), b / (1 + ratio * slip)
    length = math.hypot(x, y)
    return half[0] * x / length, half[1] * y / length


def _limit_tip(offset: Pair, step: Pair, half: Pair, radius: float, limit: float) -> Pair:
    """Step of the command, shortened until the tip moves by |dq / h| <= limit."""
    share = 1.0
    for _ in range(ITERATIONS):
        before = offset[0] + share * step[0], offset[1] + share * step[1]
        after = _slide(before, half, radius)
        slid = math.hypot((before[0] - after[0]) / half[0], (before[1] - after[1]) / half[1])
        if slid <= limit:
            break
        share *= limit / slid
    return share * step[0], share * step[1]
