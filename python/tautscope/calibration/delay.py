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

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tautscope.calibration.delay_probes import Signal, fit_model, fit_turning_points
from tautscope.calibration.delay_search import DelaySearch, Probe
from tautscope.dof import Dof
from tautscope.errors import SignalError

Floats = NDArray[np.float64]

LIMIT = 5.0
"""Largest magnitude of a delay that is searched, unless another is given [s]."""
AGREEMENT = 0.15
"""Largest difference of the probes [s]; the model is late by up to 0.12 s where DOFs share their
friction and move at once."""
LEAST_IMAGES = 50
"""Images with a measured tip."""
MOST_POSITIONS = 200_000
"""Motor positions that are used; of longer records every second, third, ..."""


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

    delay: float
    delay_std: float
    drift: float
    drift_std: float
    reason: str = ""
    model: Probe | None = None
    turning_points: Probe | None = None

    @property
    def is_known(self) -> bool:
        """Whether there is an answer."""
        return not self.reason

    def motor_time(self, stamps: ArrayLike, first: float) -> Floats:
        """Times of the motors' clock (n,) [s] that images stamped (n,) [s] show."""
        values = np.asarray(stamps, dtype=np.float64)
        return values - self.delay - self.drift * (values - first)

    def to_json(self) -> dict[str, Any]:
        """The values by name; None where unknown."""
        document = asdict(self) | {"is_known": self.is_known}
        return {
            name: None if isinstance(value, float) and math.isnan(value) else value
            for name, value in document.items()
        }


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
        SignalError: Times do not increase, shapes do not match, or a motor position is not finite.
    """
    times, motors, stamps, tips = _checked(times, motors, stamps, tips)
    step = max(1, len(times) // MOST_POSITIONS)
    times, motors = times[::step], motors[::step]
    signals = [
        Signal(times, motors, dof, stamps, tips[:, dof])
        for dof in Dof
        if np.ptp(motors[:, dof]) > 0
        and np.count_nonzero(np.isfinite(tips[:, dof])) >= LEAST_IMAGES
    ]
    if not np.any(np.ptp(motors, axis=0) > 0):
        return _unknown("no motor moved")
    if not signals:
        seen = int(np.isfinite(tips).sum(axis=0).max(initial=0))
        return _unknown(
            f"only {seen} images measure a DOF whose motor moved; at least {LEAST_IMAGES} are "
            "needed"
        )
    search = DelaySearch(signals, stamps, limit)
    results: list[Probe] = []
    for name, fit in (("model", fit_model), ("turning points", fit_turning_points)):
        found = search.run(fit, is_model=fit is fit_model)
        if isinstance(found, str):
            return _unknown(f"{name}: {found}", *results)
        results.append(found)
    model, turning_points = results
    return _combined(model, turning_points, float(stamps[-1] - stamps[0]))


def _combined(model: Probe, turning_points: Probe, span: float) -> DelayEstimate:
    difference = abs(model.middle - turning_points.middle)
    apart = difference + span / 2 * max(
        0.0,
        abs(model.drift - turning_points.drift)
        - 3 * math.hypot(model.drift_std, turning_points.drift_std),
    )
    if apart > AGREEMENT:
        return _unknown(
            f"the probes disagree by {apart:.2f} s: the model says {model.middle:.3f} s, the "
            f"turning points {turning_points.middle:.3f} s in the middle of the record",
            model,
            turning_points,
        )
    std = max(turning_points.delay_std, difference / 2)
    if std > AGREEMENT / 1.5:
        return _unknown(f"uncertain by {std:.2f} s", model, turning_points)
    found = turning_points
    drift_std = max(model.drift_std, found.drift_std)
    least = min(abs(model.drift), abs(found.drift))
    is_drifting = model.drift * found.drift > 0 and least > 3 * drift_std
    return DelayEstimate(
        found.delay if is_drifting else found.middle,
        std,
        found.drift if is_drifting else 0.0,
        drift_std,
        "",
        model,
        turning_points,
    )


def _unknown(
    reason: str, model: Probe | None = None, turning_points: Probe | None = None
) -> DelayEstimate:
    nan = math.nan
    return DelayEstimate(nan, nan, nan, nan, reason, model, turning_points)


def _checked(
    times: ArrayLike, motors: ArrayLike, stamps: ArrayLike, tips: ArrayLike
) -> tuple[Floats, Floats, Floats, Floats]:
    arrays = [np.asarray(each, dtype=np.float64) for each in (times, motors, stamps, tips)]
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
