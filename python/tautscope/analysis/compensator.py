"""The loop of N axes for the slack of records: its configuration, and a program that runs it."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np

from tautscope._core import MOST_RANGE, MOST_SENSORS
from tautscope.analysis.identification import Identification
from tautscope.analysis.setpoints import ramped
from tautscope.config import Config
from tautscope.config.control import MOST_TICKS
from tautscope.config.fields import MOST_RATIO
from tautscope.runs.records import Record
from tautscope.runs.units import ANGLES, LENGTHS

Parts = Mapping[str, tuple[Record, Identification]]
"""Name of a degree of freedom -> its record, and what was identified."""
MARGIN, HASTE = 1.5, 2.0
"""Width that is compensated, and travel beyond that of the record, over the width found; and speed
that is followed over that of the record."""
WINDOW, MOST_WINDOWS = 1 / 8, 100_000
"""Of a median stroke, over which a speed is measured; and how often."""
MOST_SPEED = {"m": 10.0, "rad": 1000.0}
"""That a configuration may have [m/s or rad/s]."""
MOST_AGE = MOST_TICKS * Config().control.period
"""Of a measurement that the loop can use [s]: the longest history of its command."""
MOST_DELAY = MOST_AGE - Config().safety.frame_age
"""Of a tip that may be as old as usual beside it [s]."""
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
sensors = np.array(SENSORS)  # of the degrees of freedom
for compensate in (False, True):
    rig = with_actuators(PlayRig(config, [dof.expected_width for dof in config.dof]), config)
    loop, sample, errors = HysteresisReduction(config, compensate), rig.reset(), []
    while sample.time < 40.0:
        reference = (low + high) / 2 + (high - low) / 4 * np.sin(sample.time)  # [m or rad]
        sample = rig.step(loop.step(reference, sample.time))
        for tip in sample.measurement:  # stamped as in the record: measurement.delays too late
            for sensor, delay in enumerate(config.measurement.delays or [0.0]):
                values = np.where(sensors == sensor, tip.values, np.nan)
                loop.on_tip(values, tip.captured_at + delay, sensor=sensor)
        errors.append(sample.true_state - reference)
    print("compensated:" if compensate else "without:", np.std(errors[-4000:], axis=0))
'''


def scale_of(record: Record, found: Identification) -> float:
    """Metres or radians per unit of a tip; with a unit that has no name, no loop is too slow."""
    unit = record.units[1]
    kind = "m" if unit in LENGTHS else "rad" if unit in ANGLES else ""
    scale = LENGTHS.get(unit) or ANGLES.get(unit) or UNNAMED
    extent = float(np.nanmax(record.measured) - np.nanmin(record.measured))
    speed = HASTE * abs(found.gain) * speed_of(record, found) if record.is_timed else 0.0
    while scale * extent > _LARGEST[kind] or (not kind and scale * speed > MOST_SPEED["m"]):
        scale *= UNNAMED
    return scale


def loop_unit(record: Record) -> Literal["m", "rad"]:
    """The unit that the loop has for a tip."""
    return "rad" if record.units[1] in ANGLES else "m"


def tip_interval(record: Record) -> float:
    """Median interval between two measured tips [s, or samples without a time]."""
    return float(np.median(np.diff(record.clock[np.isfinite(record.measured)])))


def late_by(record: Record, found: Identification) -> float:
    """Delay, if it differs from 0 by more than chance and half a sample, else 0."""
    delay = found.delay.value
    return delay if abs(delay) > _doubt(record, found) else 0.0


def is_too_late(record: Record, found: Identification) -> bool:
    """Whether the loop cannot use a tip, since its history of commands is too short."""
    return record.is_timed and late_by(record, found) > MOST_DELAY


def speed_of(record: Record, found: Identification) -> float:
    """Speed of the command [its unit/s], which it exceeds for 1 % of the time.

    Over `WINDOW` of a stroke: over a sample it is that of the encoder's steps and of time stamps.
    """
    clock, command = record.clock, ramped(record)
    window = WINDOW * min(found.stroke, float(clock[-1] - clock[0]))
    begins = np.linspace(clock[0], clock[-1] - window, MOST_WINDOWS)
    moved = np.interp(begins + window, clock, command) - np.interp(begins, clock, command)
    return float(np.quantile(np.abs(moved), 0.99)) / window


def _doubt(record: Record, found: Identification) -> float:
    """By which a delay is uncertain: half its interval, and at least half a sample."""
    clock = record.clock
    return max(found.delay.half, float(clock[-1] - clock[0]) / len(clock) / 2)


def sensors_of(parts: Parts) -> tuple[list[int], list[float]]:
    """The sensor of each degree of freedom, and the delay of each sensor [s]; none if all are 0.

    Tips are of one sensor unless their delays differ by more than their uncertainty. Of more than
    `MOST_SENSORS` delays the nearest become one.
    """
    late = _late(parts)
    if not any(late):
        return [0] * len(late), []
    doubts = [_doubt(*part) for part in parts.values()]
    groups: list[list[int]] = []

    def delay(group: Sequence[int]) -> float:
        return float(np.mean([late[each] for each in group]))

    for each in np.argsort(late, kind="stable").tolist():
        last = groups[-1][-1] if groups else each
        if not groups or late[each] - late[last] > doubts[each] + doubts[last]:
            groups.append([])
        groups[-1].append(each)
    while len(groups) > MOST_SENSORS:
        k = int(np.argmin(np.diff([delay(group) for group in groups])))
        groups[k : k + 2] = [groups[k] + groups[k + 1]]
    groups.sort(key=min)
    sensors = [[each in group for group in groups].index(True) for each in range(len(late))]
    return sensors, [delay(group) for group in groups]


def shared_delays(parts: Parts) -> dict[str, float]:
    """Delays of `sensors_of` [s] that are not those of the degrees of freedom that have them."""
    sensors, delays = sensors_of(parts)
    if len(delays) < MOST_SENSORS:
        return {}
    return {
        name: delays[sensor]
        for name, sensor, own in zip(parts, sensors, _late(parts), strict=True)
        if abs(delays[sensor] - own) > 2 * _doubt(*parts[name])
    }


def _late(parts: Parts) -> list[float]:
    """Delays of tips [s], 0 where they are not known."""
    return [max(late_by(*part), 0.0) if part[0].is_timed else 0.0 for part in parts.values()]


def compensator(parts: Parts) -> dict[str, Any]:
    """Configuration of the loop for identified slack, as a document of TOML.

    The loop's unit is m or rad, with the tip's zero; its command is a tip in the middle of the
    slack, and [actuators] turns it into the record's motors. Speeds and delays are those of the
    record's time, and left out if it has none. No tip may be later than `is_too_late`.
    """
    usual, dofs, noises = Config(), [], []
    gap = usual.safety.frame_gap
    gains, offsets, units = [], [], []
    for name, (record, found) in parts.items():
        scale = scale_of(record, found)
        width = scale * found.width.value
        path = scale * (found.gain * record.command + found.offset)
        limit = MARGIN * width
        low, high = float(path.min()) - limit, float(path.max()) + limit
        limit = max(limit, (high - low) / MOST_RANGE)
        dof = {
            "name": name,
            "unit": loop_unit(record),
            "width_limit": limit,
            "expected_width": width,
            "range": [low, high],
        }
        if record.is_timed:
            speed = abs(scale * found.gain) * speed_of(record, found)
            dof["speed"] = min(HASTE * speed + limit / 10, MOST_SPEED[loop_unit(record)])
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
    _, delays = sensors_of(parts)
    if delays:
        document["measurement"]["delays"] = delays
        age = min(max(usual.safety.frame_age, 1.5 * max(delays)), MOST_AGE)
        safety["frame_age"] = age
        if age > usual.control.history:
            document["control"] = {"history": age}
    if safety:
        document["safety"] = safety
    return {name: _rounded(section) for name, section in document.items()}


def notes(parts: Parts) -> list[str]:
    """What a person has to check in a `compensator`."""
    found = [
        "[[dof]] is in m or rad, with the tip's zero; [actuators] has the motors of the record.",
        f"range: motion of the record and {MARGIN:g} slacks more. May your motors go there?",
        f"law.change_rate: for a sensor that is never wrong, else {Config().law.change_rate:g}.",
    ]
    untimed = [name for name, (record, _) in parts.items() if not record.is_timed]
    if len(untimed) < len(parts):
        what = f"speed: {HASTE:g} times that of the record; a faster reference is held to it."
        found.append(what)
    for name, (record, identified) in parts.items():
        unit, scale = record.units[1], scale_of(record, identified)
        if scale != (LENGTHS.get(unit) or ANGLES.get(unit)):
            what = "the file names no plausible length or angle as the tip's unit"
            found.append(f"{what}: {scale:g} {loop_unit(record)} is 1 of {name}")
    if untimed:
        found.append("The record has no time: set speed, and measurement.delays in s.")
    late = {name: late_by(*part) for name, part in parts.items() if part[0].is_timed}
    if any(delay > 0 for delay in late.values()):
        each = ", ".join(f"{name} {delay:.3g}" for name, delay in late.items())
        found.append(f"measurement.delays, if time stamps are those of the record [s]: {each}")
    sensors, delays = sensors_of(parts)
    if len(delays) > 1:
        of = ", ".join(f"{name} {k}" for name, k in zip(parts, sensors, strict=True))
        what = "its tips come with this number (sensor), NaN for what others measure"
        found.append(f"Sensor of measurement.delays, from 0 on: {of}; {what}")
    return found


def write_compensator(parts: Parts, folder: Path) -> dict[str, Any]:
    """Write compensator.toml and compensator.py into a folder; the configuration."""
    import tomlkit  # noqa: PLC0415  only writing needs it

    document = compensator(parts)
    comments = "".join(f"# {note}\n" for note in notes(parts))
    text = f"{comments}\n{tomlkit.dumps(document)}"
    (folder / "compensator.toml").write_text(text, encoding="utf-8")
    program = PROGRAM.replace("SENSORS", str(sensors_of(parts)[0]))
    (folder / "compensator.py").write_text(program, encoding="utf-8")
    return document


def _rounded(value: Any) -> Any:
    """Numbers of six significant digits."""
    if isinstance(value, dict):
        return {key: _rounded(each) for key, each in value.items()}
    if isinstance(value, list):
        return [_rounded(each) for each in value]
    return float(f"{value:.6g}") if isinstance(value, float) else value
