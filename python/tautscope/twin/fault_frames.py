"""Fault models of the camera: measured features, images, arrival times and time stamps.

Frames are not changed in place, and their ground truth stays.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from tautscope.loop.rig import Frame
from tautscope.twin.fault_state import FaultState, Floats

Arrivals = list[tuple[float, Frame]]
"""Arrival time [s] and frame."""

PIXEL_NOISE = 0.2
"""Standard deviation of the noise on a frozen measurement [px]."""
_SWAPPED = [2, 3, 0, 1]


@dataclass(frozen=True, slots=True, eq=False)
class FeatureFrame(Frame):
    """A frame that carries the detected features instead of pixels.

    Attributes:
        features: (4,) [px] u and v of bands A and B; NaN for a band that was not found.
    """

    features: Floats = field(default_factory=lambda: np.full(4, np.nan))


def _shift_randomly(features: Floats, fault: FaultState) -> Floats:
    return features + fault.channel_shift(fault.size * fault.rng.uniform(-1, 1))


def _random_pixels(fault: FaultState) -> Floats:
    return fault.rng.uniform(0, np.tile(fault.image_size, 2).astype(np.float64))


def _mirror(features: Floats, fault: FaultState, *, vertically: bool) -> Floats:
    width, height = fault.image_size
    ends = np.tile((width - 1.0, height - 1.0 if vertically else 0.0), 2)
    return np.where(ends > 0, ends - features, features)


def _zoom(features: Floats, fault: FaultState) -> Floats:
    centre = np.tile(np.array(fault.image_size) / 2, 2)
    return centre + fault.size * (features - centre)


def _freeze_some(features: Floats, fault: FaultState) -> Floats:
    if fault.count() % round(fault.size) == 0:
        fault.memory["held"] = features
    held: Floats = fault.memory["held"]
    return held


def _drop_bands(features: Floats, *bands: int) -> Floats:
    return np.where(np.repeat([band in bands for band in (0, 1)], 2), np.nan, features)


def _make_non_finite(features: Floats, fault: FaultState) -> Floats:
    changed = features.copy()
    changed[fault.rng.integers(4)] = fault.rng.choice([np.nan, np.inf, -np.inf])
    return changed


FEATURE_FAULTS: dict[str, Callable[[Floats, FaultState], Floats]] = {
    "outlier": lambda s, fault: s if fault.count() else s + fault.channel_shift(fault.signed_size),
    "outliers": _shift_randomly,
    "outliers_some": lambda s, fault: s if fault.count() % 3 else _shift_randomly(s, fault),
    "noisy": lambda s, fault: s + fault.size * fault.rng.standard_normal(4),
    "random": lambda _, fault: _random_pixels(fault),
    "swapped": lambda s, _: s[_SWAPPED],
    "swapped_some": lambda s, fault: s if fault.count() % round(fault.size) else s[_SWAPPED],
    "merged": lambda s, _: np.tile((s[:2] + s[2:]) / 2, 2),
    "band_elsewhere": lambda s, fault: np.concatenate(
        [s[:2], fault.hold("spot", _random_pixels(fault)[:2])]
    ),
    "mirrored": lambda s, fault: _mirror(s, fault, vertically=False),
    "turned": lambda s, fault: _mirror(s, fault, vertically=True),
    "zoomed": _zoom,
    "biased": lambda s, fault: s + fault.channel_shift(fault.signed_size),
    "drifting": lambda s, fault: s + fault.channel_shift(fault.signed_size * fault.elapsed),
    "frozen": lambda s, fault: fault.hold("held", s),
    "frozen_noisy": lambda s, fault: (
        fault.hold("held", s) + PIXEL_NOISE * fault.rng.standard_normal(4)
    ),
    "frozen_some": _freeze_some,
    "band_a_lost": lambda s, _: _drop_bands(s, 0),
    "band_b_lost": lambda s, _: _drop_bands(s, 1),
    "bands_lost": lambda s, _: _drop_bands(s, 0, 1),
    "bands_some": lambda s, fault: (
        s if int(fault.elapsed / fault.size) % 2 else _drop_bands(s, 0, 1)
    ),
    "not_finite": _make_non_finite,
}
"""Kind -> model of the measured features s (4,)."""

IMAGE_FAULTS: dict[str, Callable[[NDArray[np.uint8], FaultState], NDArray[np.uint8]]] = {
    "random": lambda image, fault: fault.rng.integers(0, 256, image.shape, np.uint8),
    "mirrored": lambda image, _: np.ascontiguousarray(image[:, ::-1]),
    "turned": lambda image, _: np.ascontiguousarray(image[::-1, ::-1]),
    "frozen": lambda image, fault: fault.hold("held", image),
    "bands_lost": lambda image, _: np.zeros_like(image),
}
"""Kind -> model of the image, for the kinds that apply to images."""


def _stamped(due: float, frame: Frame, captured_at: float) -> Arrivals:
    return [(due, replace(frame, captured_at=captured_at))]


def _frame_interval(frame: Frame, fault: FaultState) -> float:
    """Time since the previous frame [s]."""
    last: float = fault.memory.get("last", frame.captured_at)
    fault.memory["last"] = frame.captured_at
    return frame.captured_at - last


def _reorder(due: float, frame: Frame, fault: FaultState) -> Arrivals:
    if fault.count() % 2 == 0:
        fault.memory["kept"] = frame
        return []
    return [(due, frame), (due + 0.5 * _frame_interval(frame, fault), fault.memory["kept"])]


def _limit_rate(due: float, frame: Frame, fault: FaultState) -> Arrivals:
    if fault.elapsed < fault.memory.get("next", 0.0):
        return []
    fault.memory["next"] = fault.elapsed + 1 / fault.size
    return [(due, frame)]


def _slow_stamps(due: float, frame: Frame, fault: FaultState) -> Arrivals:
    start = fault.hold("start", frame.captured_at)
    return _stamped(due, frame, start + fault.size * (frame.captured_at - start))


ARRIVAL_FAULTS: dict[str, Callable[[float, Frame, FaultState], Arrivals]] = {
    "late": lambda due, frame, fault: [(due + fault.size, frame)],
    "late_unknown": lambda due, frame, fault: _stamped(
        due + fault.size, frame, frame.captured_at + fault.size
    ),
    "jitter": lambda due, frame, fault: [(due + fault.size * fault.rng.uniform(), frame)],
    "stamp_jitter": lambda due, frame, fault: _stamped(
        due, frame, min(frame.captured_at + fault.size * fault.rng.uniform(-1, 1), due)
    ),
    "duplicate": lambda due, frame, fault: [
        (due, frame),
        (due + 0.5 * _frame_interval(frame, fault), frame),
    ],
    "reordered": _reorder,
    "dropped": lambda due, frame, fault: [] if fault.rng.uniform() < fault.size else [(due, frame)],
    "camera_off": lambda _due, _frame, _fault: [],
    "slow_camera": _limit_rate,
    "stamp_hour": lambda due, frame, fault: _stamped(due, frame, frame.captured_at + fault.size),
    "stamp_nan": lambda due, frame, _: _stamped(due, frame, np.nan),
    "stamp_stuck": lambda due, frame, fault: _stamped(
        due, frame, fault.hold("held", frame.captured_at)
    ),
    "stamp_slow": _slow_stamps,
}
"""Kind -> model of arrival time, time stamp and loss: one frame in, the arriving frames out."""
