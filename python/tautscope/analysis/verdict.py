"""The answer to a record: slack, how sure, what compensation would do, what to do next."""

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from tautscope._core import MOST_SENSORS
from tautscope.analysis.comparison import check_motion
from tautscope.analysis.compensation import PERIOD, Compensation, simulate
from tautscope.analysis.compensator import (
    MOST_DELAY,
    MOST_SPEED,
    Parts,
    compensator,
    is_too_late,
    late_by,
    loop_unit,
    scale_of,
    shared_delays,
    speed_of,
)
from tautscope.analysis.findings import (
    CURVE,
    Finding,
    curve_finding,
    gain_finding,
    identify_without_repeats,
    without_errors,
)
from tautscope.analysis.identification import EXCHANGE, Identification, Interval
from tautscope.analysis.setpoints import held_for
from tautscope.report.tables import finite
from tautscope.runs.records import Record

PARSIMONY = 1.05
"""A simpler explanation is as good if it leaves this factor of the error at most."""
LEAST_TICKS = 10
"""Of the loop in a stroke, for what it can follow."""
ROUNDING = 1e-6
"""Smaller errors, over the extent of the tip, are those of the fit: the record is exact."""


@dataclass(frozen=True, eq=False)
class Verdict:
    """What a record of one degree of freedom says.

    Attributes:
        name: Of the degree of freedom.
        columns: Those of command and tip.
        record: Without the samples that were not measured.
        found: Slack, delay, gain and drift.
        findings: What is wrong with the record.
        compensation: What the loop would do; None where there are no settings.
        settings: Of the loop, see `compensator`; None where nothing is identified, or the tip is
            too late for the loop.
    """

    name: str
    columns: tuple[str, str]
    record: Record
    found: Identification
    findings: tuple[Finding, ...]
    compensation: Compensation | None
    settings: dict[str, Any] | None

    @property
    def helps(self) -> bool:
        """Whether the compensator would help."""
        return self.compensation is not None and self.compensation.helps

    @property
    def text(self) -> str:
        """One paragraph."""
        found = self.found
        if found.is_identified:
            parts = [f"The slack is {self.width} (95 % interval, {found.strokes} strokes)."]
        elif found.is_aligned:
            aligned = f"aligned by its delay of {self._delay()}" if self._is_late else "aligned"
            parts = [
                f"There is no slack to compensate: {aligned}, the slack is 0, "
                f"at most {self._number(found.width.high)}."
            ]
        else:
            parts = [f"The slack is not identified, and there are no settings: {found.missing}."]
        if found.is_related:
            parts += [self._relation(), self._explanation()]
        if self.compensation is not None:
            before, after = self.compensation.before, self.compensation.after
            verb = "would fall" if self.helps else "would not fall"
            parts.append(
                "What the loop would reach is not known: simulated with this record's motion it "
                f"stopped {self.compensation.held}"
                if self.compensation.held
                else f"With the loop the tip's RMS error {verb} from {self._number(before)} to "
                f"{self._number(after)}, simulated on plays fitted to this record, with its delay "
                "and noise."
            )
            if late_by(self.record, self.found) > 0:
                parts.append(
                    "This holds if the delay is the sensor's; a tip that itself lags stays late."
                )
        listed = "; ".join(str(finding) for finding in self.findings)
        parts.append(
            f"Found in the record: {listed}." if listed else "Nothing is wrong with the samples."
        )
        return " ".join([*parts, f"Next: {self._next()}."])

    def to_json(self) -> dict[str, Any]:
        """The entry of a degree of freedom in ``tautscope analyze --json``."""
        found = self.found
        is_known = found.is_related and math.isfinite(found.width.high)
        width = found.width.value if found.is_identified else 0.0 if found.is_aligned else None
        return {
            "name": self.name,
            "command": self.columns[0],
            "measured": self.columns[1],
            "verdict": self.text,
            "identified": found.is_identified,
            "aligned": found.is_aligned,
            "width": width,
            "interval": [found.width.low, found.width.high] if is_known else None,
            "delay": found.delay.value if is_known else None,
            "delay_interval": [found.delay.low, found.delay.high] if is_known else None,
            "delay_unit": self.record.clock_unit,
            "gain": found.gain if is_known else None,
            "drift": float(np.ptp(found.drift)) if is_known else None,
            "noise": found.noise if is_known else None,
            "strokes": found.strokes,
            "p_value": found.p_value,
            "missing": found.missing or None,
            "explanations": finite(found.explanations),
            "compensation": None
            if self.compensation is None
            else {name: getattr(self.compensation, name) for name in ("before", "after", "helps")},
            "findings": [asdict(finding) for finding in self.findings],
            "settings": self.settings,
        }

    @property
    def _is_late(self) -> bool:
        return late_by(self.record, self.found) != 0.0

    def _number(self, value: float) -> str:
        unit = self.record.units[1]
        return f"{value:.3g} {unit}".rstrip()

    @property
    def width(self) -> str:
        """The width with half its interval, and its unit."""
        return f"{plus_minus(self.found.width)} {self.record.units[1]}".rstrip()

    def _delay(self) -> str:
        return f"{plus_minus(self.found.delay)} {self.record.clock_unit}"

    def _relation(self) -> str:
        gain = f"The tip follows the command with a gain of {self.found.gain:.3g}"
        if not self._is_late:
            return f"{gain} and no delay that can be seen ({self._delay()})."
        return f"{gain} and a delay of {self._delay()}."

    def _explanation(self) -> str:
        errors = self.found.explanations
        least = max(min(errors.values()), ROUNDING * float(np.ptp(self.found.predicted)))
        best = next(name for name, error in errors.items() if error <= PARSIMONY * least)
        others = [f"{name} {self._number(errors[name])}" for name in errors if name != best]
        return (
            f"What explains the record best is {best}, which leaves {self._number(errors[best])} "
            f"RMS ({', '.join(others[:3])})."
        )

    def _next(self) -> str:
        found = self.found
        if found.is_identified:
            return self._use()
        if found.is_aligned:
            if self._is_late:
                return self._shift()
            return "command the motor directly; the error that remains is not slack"
        if found.is_related and any(CURVE in each.what for each in self.findings):
            return (
                "record strokes where the tip follows the command in a line, away from ends and "
                "dead bands: more strokes through the curve make the width no clearer"
            )
        return found.remedy

    def _use(self) -> str:
        """What to do with a slack that is identified."""
        found = self.found
        if found.is_early:
            return EXCHANGE
        if self.settings is None:
            return self._shift()
        if self.helps:
            late = late_by(self.record, found) if self.record.is_timed else 0.0
            stamps = "; its measurement.delays is for time stamps as in the record"
            return f"run compensator.toml{stamps if late > 0 else ''}"
        if self.compensation is not None and self.compensation.held:
            return "try compensator.toml with a smooth reference, or record a slower motion"
        return "measure the tip more often, earlier or with less noise, and record again"

    def _shift(self) -> str:
        late = f"{self.found.delay.value:.3g} {self.record.clock_unit}"
        return f"subtract {late} from the tip's time stamps"


def judge(
    record: Record, name: str = "tip", columns: tuple[str, str] = ("command", "tip")
) -> Verdict:
    """Leave out wrong samples of a record, fit its slack, and simulate the loop.

    Args:
        record: Actuator and tip, each in any unit.
        name: Of the degree of freedom.
        columns: Those of command and tip.

    Raises:
        RecordError: Command or tip does not move in the first half.
    """
    record, findings = without_errors(record)
    check_motion(record)
    record, found, repeated = identify_without_repeats(record)
    findings += repeated
    if held := held_for(record):
        what = (
            f"it is setpoints, each held for {held:.2g} {record.clock_unit}, which the motor "
            "follows in its own way: record the motor's own position"
        )
        findings.append(Finding("command", what))
    if found.is_identified or found.is_aligned:
        drift, extent = float(np.ptp(found.drift)), float(np.ptp(found.predicted))
        if drift > max(3 * found.noise, 0.03 * extent):
            findings.append(Finding("tip", f"it drifts by {drift:.3g} over the record"))
    if found.is_related:
        more = gain_finding(record, found.gain), curve_finding(record, found)
        findings += [each for each in more if each is not None]
        if found.is_early:
            what = (
                f"it moves {-found.delay.value:.3g} {record.clock_unit} before its command: are "
                "--command and --measured swapped, or the motor's time stamps late?"
            )
            findings.append(Finding("tip", what))
    is_late = is_too_late(record, found)
    if found.is_identified:
        findings += _limits(record, found)
    parts = {name: (record, found)} if found.is_identified and not is_late else {}
    effect = simulate(parts, name) if parts else None
    settings = compensator(parts) if parts else None
    return Verdict(name, columns, record, found, tuple(findings), effect, settings)


def _limits(record: Record, found: Identification) -> Iterator[Finding]:
    """What of a record is beyond what a loop can have."""
    if is_too_late(record, found):
        what = f"it is {late_by(record, found):.3g} s late, and the loop can use {MOST_DELAY:.3g} s"
        yield Finding("tip", what)
    if not record.is_timed:
        return
    unit = loop_unit(record)
    speed = scale_of(record, found) * abs(found.gain) * speed_of(record, found)
    if speed > MOST_SPEED[unit]:
        most = f"{MOST_SPEED[unit]:g}: check the units of time and tip"
        yield Finding("tip", f"it moves at {speed:.3g} {unit}/s, and the loop follows {most}")
    if found.stroke < LEAST_TICKS * PERIOD:
        every = f"a command every {PERIOD:g} s: check the unit of the time"
        yield Finding("command", f"a stroke takes {found.stroke:.3g} s, and the loop has {every}")


def parts_of(verdicts: Iterable[Verdict]) -> Parts:
    """What a `compensator` for these verdicts is made from: those that have settings."""
    return {each.name: (each.record, each.found) for each in verdicts if each.settings is not None}


def together(verdicts: Sequence[Verdict]) -> list[Verdict]:
    """Verdicts that say what one loop of all would do, which has settings in common."""
    parts = parts_of(verdicts)
    if len(parts) < 2:
        return list(verdicts)
    shared = shared_delays(parts)

    found = []
    for each in verdicts:
        findings, effect = each.findings, each.compensation
        if each.name in shared:
            what = (
                f"compensator.toml has a delay of {shared[each.name]:.3g} s for it, since the "
                f"loop has at most {MOST_SENSORS} sensors: analyze fewer columns at once"
            )
            findings += (Finding("tip", what),)
        if each.name in parts:
            effect = simulate(parts, each.name)
        found.append(replace(each, findings=findings, compensation=effect))
    return found


def plus_minus(interval: Interval) -> str:
    """A value with half its interval, both with two digits of the half."""
    half = interval.half
    if not math.isfinite(half):
        return f"{interval.value:.3g} ± ?"
    size = max(half, 1e-3 * abs(interval.value), 1e-12)
    places = 1 - math.floor(math.log10(size))
    shown = max(places, 0)
    return f"{round(interval.value, places):.{shown}f} ± {round(half, places):.{shown}f}"
