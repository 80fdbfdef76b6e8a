"""The loop of N axes for the slack of records: its configuration, and a program that runs it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from tautscope._core import MOST_RANGE
from tautscope.analysis.identification import Identification
from tautscope.config import Config
from tautscope.config.fields import MOST_RATIO
from tautscope.runs.records import Record
from tautscope.runs.units import ANGLES, LENGTHS

MARGIN, HASTE = 1.5, 2.0
"""Width that is compensated, and travel beyond that of the record, over the width found; and speed
that is followed over that of the record."""
CHANGE_RATE = 0.1
"""Of the law: its default is for images, of which some are wrong; a record has a sensor."""
GAP, LONGEST_GAP = 3.0, 5.0
"""Time without a tip after which the sensor counts as silent: in intervals of the record, and at
most [s]."""
UNNAMED = 1e-3
"""Metres per unit of a tip whose unit the file does not name, or a thousandth of it, and so on."""
_LARGEST = {"m": 1.0, "rad": 100.0, "": 0.1}
"""Largest motion of a tip in its unit [m or rad]: one that is larger is in another unit."""
PROGRAM = '''"""Run compensator.toml on plays; PlayRig stands for your motors and sensor."""

from pathlib import Path

import numpy as np
from tautscope import HysteresisReduction, PlayRig, load_config
from tautscope.loop.actuators import with_actuators

config = load_config(Path(__file__).with_name("compensator.toml"))
low, high = np.array([dof.range for dof in config.dof]).T
for compensate in (False, True):
    rig = with_actuators(PlayRig(config, [dof.expected_width for dof in config.dof]), config)
    loop, sample, errors = HysteresisReduction(config, compensate), rig.reset(), []
    while sample.time < 40.0:
        reference = (low + high) / 2 + (high - low) / 4 * np.sin(sample.time)  # [m or rad]
        sample = rig.step(loop.step(reference, sample.time))
        for tip in sample.measurement:  # stamped as in the record: measurement.delays too late
            loop.on_tip(tip.values, tip.captured_at + max(config.measurement.delays, default=0))
        errors.append(sample.true_state - reference)
    print("compensated:" if compensate else "without:", np.std(errors[-4000:], axis=0))
'''


def scale_of(record: Record) -> float:
    """Metres or radians per unit of a tip."""
    unit = record.units[1]
    kind = "m" if unit in LENGTHS else "rad" if unit in ANGLES else ""
    scale = LENGTHS.get(unit) or ANGLES.get(unit) or UNNAMED
    extent = float(np.nanmax(record.measured) - np.nanmin(record.measured))
    while scale * extent > _LARGEST[kind]:
        scale *= UNNAMED
    return scale


def tip_interval(record: Record) -> float:
    """Median interval between two measured tips [s, or samples without a time]."""
    return float(np.median(np.diff(record.clock[np.isfinite(record.measured)])))


def late_by(record: Record, found: Identification) -> float:
    """Delay, if it differs from 0 by more than chance and half a sample, else 0."""
    clock = record.clock
    tick = float(clock[-1] - clock[0]) / len(clock)
    delay = found.delay.value
    return delay if abs(delay) > max(found.delay.half, tick / 2) else 0.0


def compensator(parts: Mapping[str, tuple[Record, Identification]]) -> dict[str, Any]:
    """Configuration of the loop for identified slack, as a document of TOML.

    The loop's unit is m or rad, with the tip's zero; its command is a tip in the middle of the
    slack, and [actuators] turns it into the record's motors. Speeds and delays are those of the
    record's time, and left out if it has none.

    Args:
        parts: Name of a degree of freedom -> its record, and what was identified.
    """
    usual, dofs, noises, delays = Config(), [], [], []
    gap = usual.safety.frame_gap
    gains, offsets, units = [], [], []
    for name, (record, found) in parts.items():
        scale = scale_of(record)
        width = scale * found.width.value
        path = scale * (found.gain * record.command + found.offset)
        limit = MARGIN * width
        low, high = float(path.min()) - limit, float(path.max()) + limit
        limit = max(limit, (high - low) / MOST_RANGE)
        dof = {
            "name": name,
            "unit": "rad" if record.units[1] in ANGLES else "m",
            "width_limit": limit,
            "expected_width": width,
            "range": [low, high],
        }
        if record.is_timed:
            steps = np.diff(record.clock)
            speeds = np.abs(np.diff(path))[steps > 0] / steps[steps > 0]
            dof["speed"] = min(HASTE * float(np.quantile(speeds, 0.99)) + limit / 10, 1000.0)
            delays.append(max(late_by(record, found), 0.0))
            gap = max(gap, min(GAP * tip_interval(record), LONGEST_GAP))
        dofs.append(dof)
        noises.append(scale * found.noise / limit)
        gains.append(1 / (scale * found.gain))
        offsets.append(-found.offset / found.gain)
        units.append(record.units[0])
    noise = min(max(1e-3, *noises), MOST_RATIO * usual.measurement.tip_deviation)
    document: dict[str, Any] = {
        "dof": dofs,
        "law": {"change_rate": CHANGE_RATE},
        "measurement": {"tip_deviation": noise},
        "actuators": {"matrix": np.diag(gains).tolist(), "offsets": offsets, "units": units},
    }
    safety = {"frame_gap": gap} if gap > usual.safety.frame_gap else {}
    if any(delays):
        document["measurement"]["delays"] = [float(np.mean(delays))]
        age = max(usual.safety.frame_age, 1.5 * max(delays))
        safety["frame_age"] = min(age, usual.control.history)
    if safety:
        document["safety"] = safety
    return {name: _rounded(section) for name, section in document.items()}


def notes(parts: Mapping[str, tuple[Record, Identification]]) -> list[str]:
    """What a person has to check in a `compensator`."""
    found = [
        "[[dof]] is in m or rad, with the tip's zero; [actuators] has the motors of the record.",
        f"range: motion of the record and {MARGIN:g} slacks more. May your motors go there?",
        f"law.change_rate: for a sensor that is never wrong, else {Config().law.change_rate:g}.",
    ]
    for name, (record, _) in parts.items():
        unit, scale = record.units[1], scale_of(record)
        if scale != (LENGTHS.get(unit) or ANGLES.get(unit)):
            what = "the file names no plausible length or angle as the tip's unit"
            found.append(f"{what}: {scale:g} {'rad' if unit in ANGLES else 'm'} is 1 of {name}")
    untimed = [name for name, (record, _) in parts.items() if not record.is_timed]
    if untimed:
        found.append("The record has no time: set speed, and measurement.delays in s.")
    late = {name: late_by(*part) for name, part in parts.items() if part[0].is_timed}
    if any(delay > 0 for delay in late.values()):
        each = ", ".join(f"{name} {delay:.3g}" for name, delay in late.items())
        found.append(f"measurement.delays, if time stamps are those of the record [s]: {each}")
    return found


def write_compensator(
    parts: Mapping[str, tuple[Record, Identification]], folder: Path
) -> dict[str, Any]:
    """Write compensator.toml and compensator.py into a folder; the configuration."""
    import tomlkit  # noqa: PLC0415  only writing needs it

    document = compensator(parts)
    comments = "".join(f"# {note}\n" for note in notes(parts))
    text = f"{comments}\n{tomlkit.dumps(document)}"
    (folder / "compensator.toml").write_text(text, encoding="utf-8")
    (folder / "compensator.py").write_text(PROGRAM, encoding="utf-8")
    return document


def _rounded(value: Any) -> Any:
    """Numbers of six significant digits."""
    if isinstance(value, dict):
        return {key: _rounded(each) for key, each in value.items()}
    if isinstance(value, list):
        return [_rounded(each) for each in value]
    return float(f"{value:.6g}") if isinstance(value, float) else value
