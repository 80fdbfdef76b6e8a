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


FeatureFault = Callable[[Floats, FaultState], Floats]
ImageFault = Callable[[NDArray[np.uint8], FaultState], NDArray[np.uint8]]
ArrivalFault = Callable[[float, Frame, FaultState], Arrivals]


def _shift_randomly(features: Floats, fault: FaultState) -> Floats:
    return features + fault.channel_shift(fault.spec.size * fault.rng.uniform(-1, 1))


def _shift_once(features: Floats, fault: FaultState) -> Floats:
    sign = fault.sign
    return features if fault.count() else features + fault.channel_shift(sign * fault.spec.size)


def _every_third(model: FeatureFault) -> FeatureFault:
    """The model, applied to every third frame only."""
    return lambda features, fault: features if fault.count("some") % 3 else model(features, fault)


def _random_pixels(fault: FaultState) -> Floats:
    return fault.rng.uniform(0, np.tile(fault.image_size, 2).astype(np.float64))


def _swap_some_bands(features: Floats, fault: FaultState) -> Floats:
    return features if fault.count() % round(fault.spec.size) else features[_SWAPPED]


def _fix_band_b(features: Floats, fault: FaultState) -> Floats:
    return np.concatenate([features[:2], fault.hold("spot", _random_pixels(fault)[:2])])


def _mirror(features: Floats, fault: FaultState, *, vertically: bool) -> Floats:
    width, height = fault.image_size
    ends = np.tile((width - 1.0, height - 1.0 if vertically else 0.0), 2)
    return np.where(ends > 0, ends - features, features)


def _zoom(features: Floats, fault: FaultState) -> Floats:
    centre = np.tile(np.array(fault.image_size) / 2, 2)
    return centre + fault.spec.size * (features - centre)


def _add_drift(features: Floats, fault: FaultState) -> Floats:
    return features + fault.channel_shift(fault.sign * fault.spec.size * fault.elapsed)


def _freeze_noisy(features: Floats, fault: FaultState) -> Floats:
    held: Floats = fault.hold("held", features)
    return held + PIXEL_NOISE * fault.rng.standard_normal(4)


def _freeze_some(features: Floats, fault: FaultState) -> Floats:
    if fault.count() % round(fault.spec.size) == 0:
        fault.memory["held"] = features
    held: Floats = fault.memory["held"]
    return held


def _drop_bands(features: Floats, *bands: int) -> Floats:
    lost = np.repeat([band in bands for band in (0, 1)], 2)
    return np.where(lost, np.nan, features)


def _drop_bands_alternately(features: Floats, fault: FaultState) -> Floats:
    return features if int(fault.elapsed / fault.spec.size) % 2 else _drop_bands(features, 0, 1)


def _make_non_finite(features: Floats, fault: FaultState) -> Floats:
    changed = features.copy()
    changed[fault.rng.integers(4)] = fault.rng.choice([np.nan, np.inf, -np.inf])
    return changed


FEATURE_FAULTS: dict[str, FeatureFault] = {
    "outlier": _shift_once,
    "outliers": _shift_randomly,
    "outliers_some": _every_third(_shift_randomly),
    "noisy": lambda features, fault: features + fault.spec.size * fault.rng.standard_normal(4),
    "random": lambda _, fault: _random_pixels(fault),
    "swapped": lambda features, _: features[_SWAPPED],
    "swapped_some": _swap_some_bands,
    "merged": lambda features, _: np.tile((features[:2] + features[2:]) / 2, 2),
    "band_elsewhere": _fix_band_b,
    "mirrored": lambda features, fault: _mirror(features, fault, vertically=False),
    "turned": lambda features, fault: _mirror(features, fault, vertically=True),
    "zoomed": _zoom,
    "biased": lambda features, fault: features + fault.channel_shift(fault.sign * fault.spec.size),
    "drifting": _add_drift,
    "frozen": lambda features, fault: fault.hold("held", features),
    "frozen_noisy": _freeze_noisy,
    "frozen_some": _freeze_some,
    "band_a_lost": lambda features, _: _drop_bands(features, 0),
    "band_b_lost": lambda features, _: _drop_bands(features, 1),
    "bands_lost": lambda features, _: _drop_bands(features, 0, 1),
    "bands_some": _drop_bands_alternately,
    "not_finite": _make_non_finite,
}
"""Kind -> model of the measured features (4,)."""

IMAGE_FAULTS: dict[str, ImageFault] = {
    "random": lambda image, fault: fault.rng.integers(0, 256, image.shape, np.uint8),
    "mirrored": lambda image, _: np.ascontiguousarray(image[:, ::-1]),
    "turned": lambda image, _: np.ascontiguousarray(image[::-1, ::-1]),
    "frozen": lambda image, fault: fault.hold("held", image),
    "bands_lost": lambda image, _: np.zeros_like(image),
}
"""Kind -> model of the image, for the kinds that apply to images."""


def _with_stamp(frame: Frame, captured_at: float) -> Frame:
    return replace(frame, captured_at=captured_at)


def _delay_with_stamp(due: float, frame: Frame, fault: FaultState) -> Arrivals:
    return [(due + fault.spec.size, _with_stamp(frame, frame.captured_at + fault.spec.size))]


def _jitter_stamp(due: float, frame: Frame, fault: FaultState) -> Arrivals:
    error = fault.spec.size * fault.rng.uniform(-1, 1)
    return [(due, _with_stamp(frame, min(frame.captured_at + error, due)))]


def _duplicate(due: float, frame: Frame, fault: FaultState) -> Arrivals:
    return [(due, frame), (due + 0.5 * _frame_interval(frame, fault), frame)]


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
    fault.memory["next"] = fault.elapsed + 1 / fault.spec.size
    return [(due, frame)]


def _slow_stamps(due: float, frame: Frame, fault: FaultState) -> Arrivals:
    start = fault.hold("start", frame.captured_at)
    return [(due, _with_stamp(frame, start + fault.spec.size * (frame.captured_at - start)))]


ARRIVAL_FAULTS: dict[str, ArrivalFault] = {
    "late": lambda due, frame, fault: [(due + fault.spec.size, frame)],
    "late_unknown": _delay_with_stamp,
    "jitter": lambda due, frame, fault: [(due + fault.spec.size * fault.rng.uniform(), frame)],
    "stamp_jitter": _jitter_stamp,
    "duplicate": _duplicate,
    "reordered": _reorder,
    "dropped": lambda due, frame, fault: (
        [] if fault.rng.uniform() < fault.spec.size else [(due, frame)]
    ),
    "camera_off": lambda _due, _frame, _fault: [],
    "slow_camera": _limit_rate,
    "stamp_hour": lambda due, frame, fault: [
        (due, _with_stamp(frame, frame.captured_at + fault.spec.size))
    ],
    "stamp_nan": lambda due, frame, _: [(due, _with_stamp(frame, np.nan))],
    "stamp_stuck": lambda due, frame, fault: [
        (due, _with_stamp(frame, fault.hold("held", frame.captured_at)))
    ],
    "stamp_slow": _slow_stamps,
}
"""Kind -> model of arrival time, time stamp and loss: one frame in, the arriving frames out."""
