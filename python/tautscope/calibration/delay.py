"""Delay and drift between the clocks of motors and images, from a record of both.

An image stamped s shows the instrument as the motors moved it at the time

    t = s - delay - drift (s - s_0),    s_0: stamp of the first image

Backlash makes the tip late as well, so the correlation of both signals is no measure. What backlash
does not change: where a motor stops or turns, the tip stops. Two probes use this differently:

- **Model**: per DOF, during its motions, the tip is a gain times the motor plus one play of it and
  an offset per motion, m = g c(t) + w Play_r[c](t) + b; g, w, r, b and the delay by least squares.
- **Turning points**: the tip around each turning point t_j of a motor is fitted by itself,
  m = b_j + g_j c-(t) + h_j c+(t) with 0 <= h_j <= g_j, where c- is the displacement of the motor
  before t_j and c+ that after it, and with terms linear in the other motors: neither a play nor a
  memory.

Each gives corrections for many parts of the record; delay and drift are a robust line through them,
and its scatter is the uncertainty. The turning points give the answer, the model checks it.

Wrong when the tip follows its plays with a lag of its own, which is then part of the delay.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import msgspec
import numpy as np
from numpy.typing import ArrayLike, NDArray

from tautscope.calibration.delay_probes import Fit, Signal, fit_model, fit_turning_points
from tautscope.dof import Dof
from tautscope.errors import SignalError
from tautscope.loop.kinematics import Floats
from tautscope.loop.signal_checks import as_numbers, check_time

LIMIT = 5.0
"""Largest magnitude of a delay that is searched, unless another is given [s]."""
AGREEMENT = 0.15
"""Largest difference of the probes [s]."""
SIGNIFICANT = 3.0
"""Largest difference where DOFs move at once, over the joint standard deviation: where they share
their friction, both probes are wrong by more than half of the difference."""
AT_ONCE = 0.2
"""Share of the motion in which several DOFs move, above which they move at once."""
MOVING = 0.05
"""Share of its largest speed above which a motor moves."""
LARGEST_DRIFT = 0.02
"""[s/s]"""
LEAST_PARTS = 4
"""Parts of the record per probe."""
JUMP, JUMP_PARTS = 0.2, 4
"""Deviation [s] of so many successive parts from the line that is a jump."""
STRONG = 0.012
"""A tenth of a second changes the tip by 1 % of the motor's range, summed over the images."""
UNEXPLAINED = 0.5
"""Largest share of the tip's motion that a probe may leave unexplained."""
_STEP, _RATE = 0.05, 15.0  # of the first search: distance of delays [s], images per second
_GAP = 0.2  # of log scores: a second delay that is so close is as good as the first
LEAST_IMAGES = 50
"""Images with a measured tip."""
MOST_POSITIONS = 200_000
"""Motor positions that are used; of longer records every second, third, ..."""


@dataclass(frozen=True, slots=True)
class Probe:
    """Result of one probe.

    Attributes:
        delay: At the first image [s].
        middle: Delay in the middle of the record, where it is known best [s].
        delay_std: Standard deviation of `middle` [s].
        drift: [s/s].
        drift_std: Standard deviation of `drift` [s/s].
        parts: Number of parts of the record with a value of their own.
        unexplained: Share of the tip's motion that the fit does not explain.
        gains: (3,) travel of the tip over that of the motor in contact; NaN for a DOF that did not
            move, or was not seen.
    """

    delay: float
    middle: float
    delay_std: float
    drift: float
    drift_std: float
    parts: int
    unexplained: float
    gains: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class DelayEstimate:
    """Delay and drift of a record, or the reason why they are unknown.

    Attributes:
        delay: Of the first image behind the motors [s]; NaN without an answer. Negative if the
            stamps are too early, as of a video that began after the motors with stamps from 0 on.
        delay_std: Its standard deviation in the middle of the record [s]: the larger of the scatter
            and half of the difference of the probes.
        drift: Growth of the delay [s/s]; 0 where it is not significant.
        drift_std: Its standard deviation [s/s].
        reason: Why there is no answer; empty if there is one.
        model: The first probe, if it has a value.
        turning_points: The second probe, if it has a value.
    """

    delay: float = math.nan
    delay_std: float = math.nan
    drift: float = math.nan
    drift_std: float = math.nan
    reason: str = ""
    model: Probe | None = None
    turning_points: Probe | None = None

    @property
    def is_known(self) -> bool:
        """Whether there is an answer."""
        return not self.reason

    def motor_time(self, stamps: ArrayLike, first: float) -> Floats:
        """Times of the motors' clock (n,) [s] that images stamped (n,) [s] show."""
        values = as_numbers("stamps", stamps, "times")
        return values - self.delay - self.drift * (values - first)

    def to_json(self) -> dict[str, Any]:
        """The values by name, and those of the probes; None where unknown."""
        document: dict[str, Any] = msgspec.json.decode(msgspec.json.encode(self))
        return document | {"is_known": self.is_known}


def estimate_delay(
    times: ArrayLike,
    motors: ArrayLike,
    stamps: ArrayLike,
    tips: ArrayLike,
    limit: float = LIMIT,
) -> DelayEstimate:
    """Estimate delay and drift of images behind motors.

    Args:
        times: (n,) of the motor positions [s, the motors' clock], increasing.
        motors: (n, 3) motor positions [m, rad, rad].
        stamps: (m,) of the images [s, about the motors' clock], increasing.
        tips: (m, 3) tip measured in each image alone [m, rad, rad]; NaN where it is not known, see
            `tautscope.calibration.tip_states`. Its zero and scale are not used.
        limit: Largest magnitude of a delay that is searched [s].

    Returns:
        The estimate; `DelayEstimate.reason` says why there is none.

    Raises:
        SignalError: Times do not increase, shapes do not match, a motor position is not finite, or
            the limit is not a time above 0.
    """
    if not check_time("limit", limit) > 0:
        raise SignalError("limit", limit, "a time above 0 s")
    times, motors, stamps, tips = _checked(times, motors, stamps, tips)
    step = -(-len(times) // MOST_POSITIONS)
    times, motors = times[::step], motors[::step]
    signals = [
        Signal(times, motors, dof, stamps, tips[:, dof])
        for dof in Dof
        if np.ptp(motors[:, dof]) > 0
        and np.count_nonzero(np.isfinite(tips[:, dof])) >= LEAST_IMAGES
    ]
    if not np.any(np.ptp(motors, axis=0) > 0):
        return DelayEstimate(reason="no motor moved")
    if not signals:
        seen = int(np.isfinite(tips).sum(axis=0).max(initial=0))
        what = f"only {seen} images measure a DOF whose motor moved"
        return DelayEstimate(reason=f"{what}; at least {LEAST_IMAGES} are needed")
    search = _Search(signals, stamps, limit)
    model = search.run(fit_model)
    if isinstance(model, str):
        return DelayEstimate(reason=f"model: {model}")
    turning_points = search.run(fit_turning_points)
    if isinstance(turning_points, str):
        return DelayEstimate(reason=f"turning points: {turning_points}", model=model)
    span = float(stamps[-1] - stamps[0])
    return _combined(model, turning_points, span, at_once=_move_at_once(times, motors))


def moving(times: Floats, motors: Floats) -> NDArray[np.bool_]:
    """Which motors (n, m) move from each sample to the next (n - 1, m)."""
    speed = np.abs(np.diff(motors, axis=0)) / np.diff(times)[:, None]
    return np.asarray(speed > MOVING * speed.max(axis=0))


def _move_at_once(times: Floats, motors: Floats) -> bool:
    count = moving(times, motors).sum(axis=1)
    return bool(np.count_nonzero(count > 1) > AT_ONCE * np.count_nonzero(count))


def _combined(model: Probe, found: Probe, span: float, *, at_once: bool) -> DelayEstimate:
    """The answer of the turning points (`found`), checked by the model."""
    difference, drift_std = abs(model.middle - found.middle), max(model.drift_std, found.drift_std)
    joint_drift = math.hypot(model.drift_std, found.drift_std)
    apart = difference + span / 2 * max(0.0, abs(model.drift - found.drift) - 3 * joint_drift)
    joint = math.hypot(model.delay_std, found.delay_std)
    if apart > AGREEMENT or (at_once and difference > SIGNIFICANT * joint):
        remedy = "; move one degree of freedom at a time, or use `tautscope calibrate geometry`"
        reason = (
            f"the probes disagree by {apart:.2f} s: the model says {model.middle:.3f} s, the "
            f"turning points {found.middle:.3f} s in the middle of the record{remedy * at_once}"
        )
        return DelayEstimate(reason=reason, model=model, turning_points=found)
    std = max(found.delay_std, difference / 2)
    if std > AGREEMENT / 1.5:
        reason = f"uncertain by {std:.2f} s"
        return DelayEstimate(reason=reason, model=model, turning_points=found)
    least = min(abs(model.drift), abs(found.drift))
    is_drifting = model.drift * found.drift > 0 and least > 3 * drift_std
    delay, drift = (found.delay, found.drift) if is_drifting else (found.middle, 0.0)
    return DelayEstimate(delay, std, drift, drift_std, "", model, found)


class _Search:
    """Finds the delay and drift with which a probe explains the record best."""

    def __init__(self, signals: list[Signal], stamps: Floats, limit: float) -> None:
        self._signals, self._limit = signals, limit
        self._first, self._middle = float(stamps[0]), float(stamps[-1] - stamps[0]) / 2
        rate = (len(stamps) - 1) / max(2 * self._middle, 1e-9)
        self._thinned = [signal.thinned(max(1, round(rate / _RATE))) for signal in signals]

    def run(self, fit: Callable[..., Fit | None]) -> Probe | str:
        """The probe's result, or why it has none.

        The model has one minimum if there is an answer, and an error of its own in each DOF.
        """
        delays = np.arange(-self._limit, self._limit + _STEP / 2, _STEP)
        scores = np.array([_score(self._fits(fit, self._thinned, delay, 0.0)) for delay in delays])
        if not np.isfinite(scores).any():
            return "too few images around the motions of the motors"
        best = int(np.nanargmin(scores))
        if best in (0, len(delays) - 1):
            return f"no delay within {self._limit:g} s explains the record"
        is_low = (scores[1:-1] < scores[:-2]) & (scores[1:-1] < scores[2:])
        is_low &= (np.abs(delays - delays[best]) > 1.0)[1:-1] & (scores[1:-1] < scores[best] + _GAP)
        if fit is fit_model and is_low.any():
            rival = delays[1:-1][is_low][0]
            return f"{delays[best]:.1f} s and {rival:.1f} s explain the record equally well"
        return self._refine(fit, float(delays[best]))

    def _fits(
        self, fit: Callable[..., Fit | None], signals: list[Signal], delay: float, drift: float
    ) -> list[Fit]:
        found = (
            fit(signal, signal.stamps - delay - drift * (signal.stamps - self._first))
            for signal in signals
        )
        return [each for each in found if each is not None]

    def _refine(self, fit: Callable[..., Fit | None], delay: float) -> Probe | str:
        drift = 0.0
        for _ in range(8):
            fits = self._fits(partial(fit, by_parts=True), self._signals, delay, drift)
            parts = [(k, *part) for k, each in enumerate(fits) for part in each.parts]
            if len(parts) < LEAST_PARTS:
                return f"{len(parts)} motions to compare; at least {LEAST_PARTS} are needed"
            group, at, correction, weight, strength = np.array(parts).T
            x = at - self._first - self._middle
            value, std, slope, drift_std = _line(x, correction, weight, group, fit is fit_model)
            change = min(max(slope, -0.005), 0.005)
            drift += change
            delay += min(max(value, -0.2), 0.2) - change * self._middle
        middle = delay + drift * self._middle
        share = sum(_share(each) * each.count for each in fits) / sum(each.count for each in fits)
        if abs(drift) > LARGEST_DRIFT or abs(middle) > 1.2 * self._limit:
            return f"no delay within {self._limit:g} s explains the record"
        if share > UNEXPLAINED:
            return f"the motors do not explain {100 * share:.0f} % of the tip's motion"
        by_dof = {each.dof: each.gain for each in fits}
        gains = tuple(by_dof.get(dof, math.nan) for dof in Dof)
        if fit is not fit_model and (jump := _jump(at, correction, strength)) > JUMP:
            return f"the delay changes by {jump:.2f} s within the record; are images missing?"
        return Probe(delay, middle, std, drift, drift_std, len(parts), share, gains)


def _score(fits: list[Fit]) -> float:
    """Mean logarithm of the unexplained share, over the DOFs."""
    count = sum(each.count for each in fits)
    return sum(each.count * math.log(_share(each)) for each in fits) / count if count else math.nan


def _share(fit: Fit) -> float:
    return max(fit.left / fit.total, 1e-12)


def _jump(at: Floats, correction: Floats, strength: Floats) -> float:
    """Largest deviation from the line that `JUMP_PARTS` successive parts have in common [s].

    Only of parts that show it clearly: with a `strength` of at least `STRONG`.
    """
    order = np.argsort(at)
    strong = order[strength[order] >= STRONG]
    if len(strong) < JUMP_PARTS:
        return 0.0
    runs = np.lib.stride_tricks.sliding_window_view(correction[strong], JUMP_PARTS)
    return float(np.abs(np.sort(runs, axis=1)[:, 1:-1].mean(axis=1)).max())


def _line(
    x: Floats, y: Floats, weight: Floats, group: Floats, own_levels: bool
) -> tuple[float, float, float, float]:
    """Value at x = 0 and slope of a line, each with its standard deviation, with Huber's weights.

    Each group has a scatter and, if asked for, a level of its own; the value is the mean of these.
    """
    members = np.unique(group)[None, :] == group[:, None]
    levels = members if own_levels else np.ones((len(x), 1))
    design = np.column_stack([levels, x])
    size = members @ (weight @ members)
    w = weight / weight.sum()
    for _ in range(10):
        root = np.sqrt(w)
        found = np.linalg.lstsq(root[:, None] * design, root * y, rcond=1e-9)[0]
        residual = np.abs(y - design @ found)
        scatter = [max(1.4826 * np.median(residual[each]), 0.004) for each in members.T]
        scale = members @ np.array(scatter)
        huber = np.minimum(1.0, 1.5 * scale / np.maximum(residual, 1e-12))
        w = weight / size / scale**2 * huber * (members @ members.sum(axis=0))
    inverse = np.linalg.pinv(design.T @ (w[:, None] * design))
    scattered = (w * residual)[:, None] * design
    freedom = max(len(x) - design.shape[1], 1)
    covariance = inverse @ (scattered.T @ scattered) @ inverse * len(x) / freedom
    mean = np.append(w @ levels / w.sum(), 0.0)
    std = math.sqrt(float(mean @ covariance @ mean))
    return float(mean @ found), std, float(found[-1]), math.sqrt(float(covariance[-1, -1]))


def _checked(
    times: ArrayLike, motors: ArrayLike, stamps: ArrayLike, tips: ArrayLike
) -> tuple[Floats, Floats, Floats, Floats]:
    given = {"times": times, "motors": motors, "stamps": stamps, "tips": tips}
    arrays = [as_numbers(name, each, "an array of numbers") for name, each in given.items()]
    for name, clock, signal, values in (
        ("times", arrays[0], "motors", arrays[1]),
        ("stamps", arrays[2], "tips", arrays[3]),
    ):
        if clock.ndim != 1 or len(clock) < 2 or not np.all(np.diff(clock) > 0):
            raise SignalError(name, f"array {clock.shape}", "at least two increasing times")
        if values.shape != (len(clock), 3):
            raise SignalError(signal, f"array {values.shape}", f"shape ({len(clock)}, 3)")
    if not np.isfinite(arrays[1]).all():
        raise SignalError("motors", "NaN or infinite", "finite positions")
    return arrays[0], arrays[1], arrays[2], arrays[3]
