"""What faults of the camera do: to what the image says, and to when it comes.

An act is given a frame on its way, when it will arrive [s], and the moment; it gives back what
arrives when. Frames are never changed in place, and their truth is passed on as it is.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tautscope.loop.rig import Frame
from tautscope.twin.fault_kinds import Fault

Floats = NDArray[np.float64]
Arrivals = list[tuple[float, Frame]]

PIXEL_NOISE = 0.2
"""Fresh noise on a frozen measurement [px]."""


@dataclass(frozen=True, slots=True)
class FeatureFrame(Frame):
    """A frame without pixels: what a detector would have said stands in for them.

    Attributes:
        features: (4,) [px] u and v of bands A and B; NaN for both of a band not found.
    """

    features: Floats = field(default_factory=lambda: np.full(4, np.nan))


@dataclass(slots=True)
class Moment:
    """What an act may know.

    Attributes:
        fault: The one that acts.
        since: How long it has [s].
        chance: Its own generator.
        memory: Its own, kept from call to call.
        size: (width, height) of the picture [px].
        along: Gives (4,) [px/m] how the features move when the instrument is pushed outwards.
        stalls: How many there were.
    """

    fault: Fault
    since: float
    chance: np.random.Generator
    memory: dict[str, Any]
    size: tuple[int, int]
    along: Callable[[], Floats]
    stalls: int = 0

    def count(self, what: str = "count") -> int:
        """0, 1, 2, ... from call to call."""
        number: int = self.memory.get(what, 0)
        self.memory[what] = number + 1
        return number

    def first(self, what: str, value: Any) -> Any:
        """The value of the first call, at every call."""
        return self.memory.setdefault(what, value)

    def push(self, millimetres: float) -> Floats:
        """What that many mm along the channel are in the image (4,) [px]."""
        return 1e-3 * millimetres * self.along()


Seen = Callable[[Floats, Moment], Floats]
Shown = Callable[[NDArray[np.uint8], Moment], NDArray[np.uint8]]
Timed = Callable[[float, Frame, Moment], Arrivals]


def _scatter(seen: Floats, now: Moment) -> Floats:
    return seen + now.push(now.fault.size * now.chance.uniform(-1, 1))


def _outlier(seen: Floats, now: Moment) -> Floats:
    side = now.first("side", now.chance.choice((-1, 1)))
    return seen if now.count() else seen + now.push(side * now.fault.size)


def _some(act: Seen) -> Seen:
    """Every third frame only."""
    return lambda seen, now: seen if now.count("some") % 3 else act(seen, now)


def _anywhere(now: Moment) -> Floats:
    return now.chance.uniform(0, np.tile(now.size, 2).astype(np.float64))


def _swap(seen: Floats) -> Floats:
    return seen[[2, 3, 0, 1]]


def _swap_some(seen: Floats, now: Moment) -> Floats:
    return seen if now.count() % round(now.fault.size) else _swap(seen)


def _merge(seen: Floats) -> Floats:
    return np.tile((seen[:2] + seen[2:]) / 2, 2)


def _elsewhere(seen: Floats, now: Moment) -> Floats:
    return np.concatenate([seen[:2], now.first("spot", _anywhere(now)[:2])])


def _flip(seen: Floats, now: Moment, *, turn: bool) -> Floats:
    width, height = now.size
    ends = np.tile((width - 1.0, height - 1.0 if turn else 0.0), 2)
    return np.where(ends > 0, ends - seen, seen)


def _zoom(seen: Floats, now: Moment) -> Floats:
    centre = np.tile(np.array(now.size) / 2, 2)
    return centre + now.fault.size * (seen - centre)


def _drift(seen: Floats, now: Moment) -> Floats:
    side = now.first("side", now.chance.choice((-1, 1)))
    return seen + now.push(side * now.fault.size * now.since)


def _bias(seen: Floats, now: Moment) -> Floats:
    return seen + now.push(now.first("side", now.chance.choice((-1, 1))) * now.fault.size)


def _freeze_noisy(seen: Floats, now: Moment) -> Floats:
    held: Floats = now.first("held", seen)
    return held + PIXEL_NOISE * now.chance.standard_normal(4)


def _freeze_some(seen: Floats, now: Moment) -> Floats:
    if now.count() % round(now.fault.size) == 0:
        now.memory["held"] = seen
    held: Floats = now.memory["held"]
    return held


def _lose(seen: Floats, *bands: int) -> Floats:
    lost = np.repeat([band in bands for band in (0, 1)], 2)
    return np.where(lost, np.nan, seen)


def _lose_some(seen: Floats, now: Moment) -> Floats:
    return seen if int(now.since / now.fault.size) % 2 else _lose(seen, 0, 1)


def _spoil(seen: Floats, now: Moment) -> Floats:
    spoilt = seen.copy()
    spoilt[now.chance.integers(4)] = now.chance.choice([np.nan, np.inf, -np.inf])
    return spoilt


FEATURES: dict[str, Seen] = {
    "outlier": _outlier,
    "outliers": _scatter,
    "outliers_some": _some(_scatter),
    "noisy": lambda seen, now: seen + now.fault.size * now.chance.standard_normal(4),
    "random": lambda _, now: _anywhere(now),
    "swapped": lambda seen, _: _swap(seen),
    "swapped_some": _swap_some,
    "merged": lambda seen, _: _merge(seen),
    "band_elsewhere": _elsewhere,
    "mirrored": lambda seen, now: _flip(seen, now, turn=False),
    "turned": lambda seen, now: _flip(seen, now, turn=True),
    "zoomed": _zoom,
    "biased": _bias,
    "drifting": _drift,
    "frozen": lambda seen, now: now.first("held", seen),
    "frozen_noisy": _freeze_noisy,
    "frozen_some": _freeze_some,
    "band_a_lost": lambda seen, _: _lose(seen, 0),
    "band_b_lost": lambda seen, _: _lose(seen, 1),
    "bands_lost": lambda seen, _: _lose(seen, 0, 1),
    "bands_some": _lose_some,
    "not_finite": _spoil,
}
"""Measured features (4,) to what the loop is told."""

IMAGES: dict[str, Shown] = {
    "random": lambda image, now: now.chance.integers(0, 256, image.shape, np.uint8),
    "mirrored": lambda image, _: np.ascontiguousarray(image[:, ::-1]),
    "turned": lambda image, _: np.ascontiguousarray(image[::-1, ::-1]),
    "frozen": lambda image, now: now.first("held", image),
    "bands_lost": lambda image, _: np.zeros_like(image),
}
"""The same for pictures, where it can be done to them."""


def _stamped(frame: Frame, captured_at: float) -> Frame:
    return replace(frame, captured_at=captured_at)


def _late_unknown(due: float, frame: Frame, now: Moment) -> Arrivals:
    return [(due + now.fault.size, _stamped(frame, frame.captured_at + now.fault.size))]


def _stamp_jitter(due: float, frame: Frame, now: Moment) -> Arrivals:
    error = now.fault.size * now.chance.uniform(-1, 1)
    return [(due, _stamped(frame, min(frame.captured_at + error, due)))]


def _twice(due: float, frame: Frame, now: Moment) -> Arrivals:
    return [(due, frame), (due + 0.5 * _spacing(frame, now), frame)]


def _spacing(frame: Frame, now: Moment) -> float:
    """Time between the last two frames [s]."""
    last: float = now.memory.get("last", frame.captured_at)
    now.memory["last"] = frame.captured_at
    return frame.captured_at - last


def _reorder(due: float, frame: Frame, now: Moment) -> Arrivals:
    if now.count() % 2 == 0:
        now.memory["kept"] = frame
        return []
    return [(due, frame), (due + 0.5 * _spacing(frame, now), now.memory["kept"])]


def _drop(due: float, frame: Frame, now: Moment) -> Arrivals:
    return [] if now.chance.uniform() < now.fault.size else [(due, frame)]


def _slow_down(due: float, frame: Frame, now: Moment) -> Arrivals:
    if now.since < now.memory.get("next", 0.0):
        return []
    now.memory["next"] = now.since + 1 / now.fault.size
    return [(due, frame)]


def _slow_clock(due: float, frame: Frame, now: Moment) -> Arrivals:
    start = now.first("start", frame.captured_at)
    return [(due, _stamped(frame, start + now.fault.size * (frame.captured_at - start)))]


FRAMES: dict[str, Timed] = {
    "late": lambda due, frame, now: [(due + now.fault.size, frame)],
    "late_unknown": _late_unknown,
    "jitter": lambda due, frame, now: [(due + now.fault.size * now.chance.uniform(), frame)],
    "stamp_jitter": _stamp_jitter,
    "duplicate": _twice,
    "reordered": _reorder,
    "dropped": _drop,
    "camera_off": lambda _due, _frame, _now: [],
    "slow_camera": _slow_down,
    "stamp_hour": lambda due, frame, now: [
        (due, _stamped(frame, frame.captured_at + now.fault.size))
    ],
    "stamp_nan": lambda due, frame, _: [(due, _stamped(frame, np.nan))],
    "stamp_stuck": lambda due, frame, now: [
        (due, _stamped(frame, now.first("held", frame.captured_at)))
    ],
    "stamp_slow": _slow_clock,
}
"""A frame and when it is due to what arrives when."""
