"""What is wrong with the samples of a record: found, named with its lines, and left out."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tautscope.analysis.delayed_play import resolution
from tautscope.analysis.identification import Identification, identify
from tautscope.analysis.models.task import Floats, fit_samples
from tautscope.runs.records import LONGEST_INTERVAL, Record
from tautscope.runs.units import ANGLES, LENGTHS

Mask = NDArray[np.bool_]

WRAPS = (2 * np.pi, 360.0, *(2.0**bits for bits in (8, 10, 12, 13, 14, 15, 16, 20, 24, 32)))
"""Ranges after which counters and angles begin again."""
STILL = 0.05
"""Motion of an unwrapped signal, over the range of its counter, below which it did not wrap."""
FAR = 3.0
"""A value that is farther from the others than this many of their ranges was not measured."""
LONE = 4
"""Samples in a row that may be an outlier."""
SPIKE = 0.3
"""Least height of an outlier, as a share of the range."""
FEW = 1e-3
"""Share of samples that may repeat a value by chance, and do not matter."""
CURVE = "it follows the command in a curve"
CURVED = 0.8
"""Error that a cubic leaves, over that of a line, below which the relation is curved."""
_FACTORS = {
    1000.0: "the number of mm in 1 m",
    180 / np.pi: "the number of degrees in a radian",
    360.0: "the number of degrees in a turn",
    2 * np.pi: "the number of radians in a turn",
}


@dataclass(frozen=True)
class Finding:
    """Something wrong with a record.

    Attributes:
        signal: "command", "tip", "time" or "record".
        what: What was found, and what was done about it.
        rows: The first and the last line of each place.
    """

    signal: str
    what: str
    rows: tuple[tuple[int, int], ...] = ()

    def __str__(self) -> str:
        text = f"{self.signal}: {self.what}"
        if not self.rows:
            return text
        shown = [f"{a}" if a == b else f"{a} to {b}" for a, b in self.rows[:3]]
        others = len(self.rows) - 3
        more = f" and {others} more place{'s' if others > 1 else ''}" if others > 0 else ""
        is_one = len(self.rows) == 1 and self.rows[0][0] == self.rows[0][1]
        return f"{text} (line{'' if is_one else 's'} {', '.join(shown)}{more})"


def without_errors(record: Record) -> tuple[Record, list[Finding]]:
    """Leave out a long rest before the motion and what was not measured; unwrap counters."""
    findings = list(_time_findings(record))
    moved = np.flatnonzero(record.command != record.command[0])
    if len(moved) and moved[0] > len(record.command) / 2:
        first = int(moved[0]) - 1
        what = f"{first} samples of rest before the motion, left out"
        findings.append(Finding("command", what, _lines(record, [(0, first - 1)])))
        record = record.part(slice(first, None))
    signals = {"command": record.command, "tip": record.measured}
    for name, values in signals.items():
        unwrapped, period, at = _unwrapped(values)
        if len(at):
            what = f"wraps at a range of {period:.6g}; it was unwrapped"
            places = _runs(_mask(at, len(values)))
            findings.append(Finding(name, what, _lines(record, places)))
        is_far = _far(unwrapped)
        for is_wrong, what in (
            (is_far, "values far from all others, as those that mark missing ones"),
            (_spikes(np.where(is_far, np.nan, unwrapped)), "lone outliers"),
        ):
            if is_wrong.any():
                worst = unwrapped[is_wrong][np.argmax(np.abs(unwrapped[is_wrong]))]
                text = f"{is_wrong.sum()} {what}, such as {worst:.6g}, left out"
                findings.append(Finding(name, text, _lines(record, _runs(is_wrong))))
                unwrapped = np.where(is_wrong, np.nan, unwrapped)
        signals[name] = unwrapped
    command, clock = signals["command"], record.clock
    is_known = np.isfinite(command)
    filled = np.interp(clock, clock[is_known], command[is_known])
    command = np.where(is_known, command, filled)
    return replace(record, command=command, measured=signals["tip"]), findings


def identify_without_repeats(record: Record) -> tuple[Record, Identification, list[Finding]]:
    """Identify the slack, without the samples at which the tip repeats a value while it moves.

    A play at rest repeats its value rightly. So the model is fitted to the other samples, too:
    repeated ones that it contradicts were not measured, or the tip was at an end. Of an end, all
    samples are left out at which the model is near it or beyond.
    """
    time, measured = record.clock, record.measured
    found = identify(time, record.command, measured)
    seen = np.flatnonzero(np.isfinite(measured))
    is_held = _mask(seen[1:][np.diff(measured[seen]) == 0], len(measured))
    ends = {float(np.nanmin(measured)): -1.0, float(np.nanmax(measured)): 1.0}
    ends = {end: sign for end, sign in ends.items() if np.count_nonzero(measured == end) > 5}
    is_held |= np.isin(measured, list(ends))
    fresh = np.where(is_held, np.nan, measured)
    held = np.count_nonzero(is_held)
    if held < max(5, FEW * len(seen)) or len(seen) - held < 50:
        return record, found, []
    other = identify(time, record.command, fresh)
    # Noise is cut off near an end: only the model may say which samples are clear of it.
    near = {end: sign * (end - other.predicted) < 2 * other.noise for end, sign in ends.items()}
    fresh[np.any([is_held, *near.values()], axis=0)] = np.nan
    if near and np.count_nonzero(np.isfinite(fresh)) >= 50:
        other = identify(time, record.command, fresh)
    else:
        near = {}
    error, extent = other.predicted - measured, float(np.ptp(other.predicted))
    passed = [
        end
        for end, sign in ends.items()
        if np.mean(sign * error[measured == end]) > 0.05 * other.noise + 0.002 * extent
    ]
    # A sensor repeats a value until the tip has moved by half a step.
    allowed = 4 * other.noise + 0.01 * extent + resolution(measured[seen]) / 2
    repeated, at_end = [], []
    for a, b in _runs(is_held):
        if measured[a] in passed:
            at_end.append((a, b))
        elif np.max(np.abs(error[a : b + 1])) > allowed:
            repeated.append((a, b))
    if sum(b - a + 1 for a, b in repeated + at_end) < 0.2 * held:
        return record, found, []
    findings, kept = [], measured.copy()
    beyond = [near[end] for end in passed if end in near]
    for name, places, others in (
        ("it stays at its least or largest value while the command moves on", at_end, beyond),
        ("it repeats its last value while the command moves", repeated, []),
    ):
        if places:
            before = np.count_nonzero(np.isfinite(kept))
            for a, b in places:
                kept[a : b + 1] = np.nan
            for is_near in others:
                kept[is_near] = np.nan
            count = before - np.count_nonzero(np.isfinite(kept))
            longest = sorted(places, key=lambda run: run[0] - run[1])
            rows = _lines(record, longest)
            findings.append(Finding("tip", f"{name}; {count} samples left out", rows))
    return replace(record, measured=kept), identify(time, record.command, kept), findings


def gain_finding(record: Record, gain: float) -> Finding | None:
    """Whether gain and units contradict each other."""
    command, tip = record.units
    kinds = [next((k for k in (LENGTHS, ANGLES) if unit in k), None) for unit in (command, tip)]
    if command and tip and kinds[0] is not None and kinds[1] is not None:
        if kinds[0] is not kinds[1]:
            what = f"the command is in {command}, the tip in {tip}: the gain converts them"
            return Finding("record", what)
        gain *= kinds[1][tip] / kinds[0][command]
    for factor, meaning in _FACTORS.items():
        for each, near in ((factor, meaning), (1 / factor, f"1 over {meaning}")):
            if abs(abs(gain) / each - 1) < 0.03:
                what = f"the gain in one unit is {gain:.4g}, near {near}: check the units"
                return Finding("record", what)
    return None


def curve_finding(record: Record, found: Identification) -> Finding | None:
    """Whether the gain changes over the range: a cubic of the model explains much of its error."""
    seen = fit_samples(record.command, record.measured)
    path = (found.predicted - found.drift)[seen]
    error = (record.measured - found.predicted)[seen]
    extent = float(np.ptp(path))
    powers = np.polynomial.legendre.legvander(2 * (path - path.min()) / extent - 1, 3)
    curve = powers @ np.linalg.lstsq(powers, error, rcond=None)[0]
    off = float(np.max(np.abs(curve)))
    if float(np.std(error - curve)) > CURVED * float(np.std(error)) or off < 0.02 * extent:
        return None
    return Finding("tip", f"{CURVE}, up to {off:.3g} off a line")


def _time_findings(record: Record) -> Iterator[Finding]:
    if record.time is None:
        return
    steps = np.diff(record.time)
    interval = float(np.median(steps[steps > 0])) if np.any(steps > 0) else 0.0
    if interval > LONGEST_INTERVAL:
        yield Finding(
            "time",
            f"a sample every {interval:.4g} s is implausible: if the column is in ms, "
            "write its title as time [ms]",
        )
    is_whole = 1 <= interval <= LONGEST_INTERVAL and interval.is_integer()
    if is_whole and not record.time_unit and np.mean(steps == interval) > 0.9:
        yield Finding(
            "time",
            f"it rises by {interval:g} a line: these look like sample numbers, not seconds; "
            "if they are seconds, write its title as time [s]",
        )
    equal = np.count_nonzero(steps == 0)
    if equal > 0.1 * len(steps):
        instead = "" if record.is_timed else "; sample numbers are used instead"
        what = f"{equal} of {len(record.time)} lines have the time of the line before{instead}"
        yield Finding("time", what)


def _unwrapped(values: Floats) -> tuple[Floats, float, NDArray[np.intp]]:
    """Values, the range of the counter, and the samples after each wrap; none if there is none."""
    seen = np.flatnonzero(np.isfinite(values))
    none = values, 0.0, np.array([], dtype=np.intp)
    if len(seen) < 10:
        return none
    steps = np.diff(values[seen])
    sizes = np.abs(steps)
    usual = float(np.quantile(sizes, 0.9))
    extent = float(np.ptp(values[seen]))
    for period in WRAPS:
        is_wrap = sizes > period / 2
        if extent > period * (1 + 1e-6) or not 0 < np.count_nonzero(is_wrap) <= len(sizes) / 4:
            continue
        largest = float(np.max(sizes[~is_wrap], initial=0.0))
        if np.min(sizes[is_wrap]) - largest < period / 4:
            continue
        if np.all(np.abs(period - sizes[is_wrap]) <= 3 * max(usual, largest)):
            unwrapped = values.copy()
            unwrapped[seen] = np.unwrap(values[seen], period=period)
            if not _rests(unwrapped[seen], period, np.flatnonzero(is_wrap)):
                return unwrapped, period, seen[1:][is_wrap]
    return none


def _rests(unwrapped: Floats, period: float, at: NDArray[np.intp]) -> bool:
    """Whether what looked like wraps at steps was all of the motion: steps by a whole turn."""
    if np.ptp(unwrapped) < STILL * period:
        return True
    steps = np.abs(np.diff(unwrapped))
    around = np.clip(at[:, None] + [-1, 0, 1], 0, len(steps) - 1)
    return bool(np.median(steps[around].max(axis=1)) <= 1e-12 * period)


def _far(values: Floats) -> Mask:
    """Values beyond a gap that is wider than `FAR` ranges of the more than 70 % on its side."""
    is_far = np.zeros(len(values), dtype=bool)
    ordered = np.sort(values[np.isfinite(values)])
    if len(ordered) < 10 or ordered[0] == ordered[-1]:
        return is_far
    least = int(np.ceil(0.7 * len(ordered)))
    gaps = np.diff(ordered)
    for k in np.argsort(gaps)[::-1][:4].tolist():
        low, high = ordered[: k + 1], ordered[k + 1 :]
        main = low if len(low) >= least else high
        if len(main) >= least and 0 < FAR * np.ptp(main) < gaps[k]:
            is_far |= np.isfinite(values) & ((values < main[0]) | (values > main[-1]))
    return is_far


def _spikes(values: Floats) -> Mask:
    """Up to `LONE` samples in a row that jump out and back: a Hampel filter."""
    from scipy.ndimage import median_filter  # noqa: PLC0415

    seen = np.flatnonzero(np.isfinite(values))
    if len(seen) < 20:
        return np.zeros(len(values), dtype=bool)
    signal = values[seen]
    away = np.abs(signal - median_filter(signal, 2 * LONE + 1, mode="nearest"))
    extent = float(np.subtract(*np.quantile(signal, (0.98, 0.02))))
    limit = max(10 * float(np.median(away[away > 0] if away.any() else away)), SPIKE * extent)
    is_spike = _mask(seen[away > limit], len(values))
    return is_spike if is_spike.sum() <= 0.05 * len(seen) else np.zeros_like(is_spike)


def _mask(at: NDArray[np.intp], size: int) -> Mask:
    mask = np.zeros(size, dtype=bool)
    mask[at] = True
    return mask


def _runs(mask: Mask) -> list[tuple[int, int]]:
    """First and last index of each run."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]])))
    return [(int(a), int(b) - 1) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def _lines(record: Record, runs: list[tuple[int, int]]) -> tuple[tuple[int, int], ...]:
    return tuple((int(record.rows[a]), int(record.rows[b])) for a, b in runs)
