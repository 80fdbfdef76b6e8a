"""Checks of a configuration beyond the type and range of each key."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from typing import Any

import msgspec

from tautscope._core import DETECTORS
from tautscope.config.control import ControlConfig
from tautscope.config.dof import DofConfig
from tautscope.config.drives import DrivesConfig
from tautscope.config.experiment import ExperimentConfig
from tautscope.config.instrument import InstrumentConfig
from tautscope.config.safety import SafetyConfig
from tautscope.config.twin import DISTURBANCES, TwinConfig
from tautscope.dof import Dof
from tautscope.errors import ConfigError

_RANGE = "the lower limit, then the upper"


def config_error(error: msgspec.ValidationError, document: dict[str, Any]) -> ConfigError:
    """Translate an error of msgspec, which names the key but not its value."""
    message = str(error)
    expected, _, path = message.partition(" - at `$")
    path = path.rstrip("`").lstrip(".")
    unknown = re.search(r"unknown field `([^`]*)`", expected)
    missing = re.search(r"missing required field `([^`]*)`", expected)
    for match in (unknown, missing):
        if match:
            path = f"{path}.{match[1]}".lstrip(".")
    value: Any = document
    for key in re.findall(r"[^.\[\]]+", path):
        try:
            value = value[int(key)] if isinstance(value, list | tuple) else value[key]
        except (KeyError, TypeError, IndexError, ValueError):
            value = None
            break
    if unknown:
        allowed = "no such key; `tautscope config` prints all keys"
    elif missing:
        allowed = "a value: it has no default"
    else:
        allowed = expected.removeprefix("Expected ").split(", got")[0].replace("`", "")
    return ConfigError(path or "config", value, allowed)


def check_finite(value: Any, path: str) -> None:
    """Reject nan and inf, which TOML allows and ranges do not exclude.

    Raises:
        ConfigError: Names the number by its dotted path.
    """
    if isinstance(value, dict):
        for key, item in value.items():
            check_finite(item, f"{path}.{key}".lstrip("."))
    elif isinstance(value, list | tuple):
        for index, item in enumerate(value):
            check_finite(item, f"{path}[{index}]")
    elif isinstance(value, float) and not math.isfinite(value):
        raise ConfigError(path, value, "a finite number")


def check_dof(dof: Dof, settings: DofConfig) -> None:
    """The relations in a DOF's block. This and all below raise `ConfigError` with the key."""
    _require_at_most(dof.label, settings, "free_gain", "gain_limit")
    _require_at_most(dof.label, settings, "delta_minus", "delta_plus")


def check_instrument(instrument: InstrumentConfig) -> None:
    """Both bands are on the tip, one behind the other."""
    a, b, half = instrument.marker_a, instrument.marker_b, instrument.band_length / 2
    proximal = "a band on the tip, proximal of marker_b's band and not overlapping it"
    _require(half <= a <= b - 2 * half, "instrument.marker_a", a, proximal)
    _require(
        b + half <= instrument.tip_length, "instrument.marker_b", b, "a band within tip_length"
    )


def check_twin(twin: TwinConfig) -> None:
    """The relations in block ``twin``."""
    _require_at_most("twin", twin, "latency_jitter", "latency")
    _require_names("twin.disturb", twin.disturb, DISTURBANCES)
    readout, frame_period = twin.sensor.readout, 1 / twin.frame_rate
    _require(
        readout <= frame_period,
        "twin.sensor.readout",
        readout,
        f"at most one frame period, {frame_period:.3g}",
    )


def check_control(control: ControlConfig) -> None:
    """The history has 1 to 1024 ticks."""
    _require(
        1 <= control.history / control.period <= 1024,
        "control.history",
        control.history,
        f"1 to 1024 ticks of control.period = {control.period}",
    )


def check_safety(
    safety: SafetyConfig, experiment: ExperimentConfig, dofs: Mapping[Dof, DofConfig]
) -> None:
    """The relations in block ``safety``, and with the references and estimators."""
    _require_names("safety.off", safety.off, DETECTORS)
    for index, limits in enumerate(safety.command_travel):
        _require(limits[0] < limits[1], f"safety.command_travel[{index}]", limits, _RANGE)
    for dof, speed in zip(Dof, safety.reference_speed, strict=True):
        sine = experiment[dof]
        least_period = 2 * math.pi * sine.amplitude / speed
        _require(
            sine.period >= least_period or "reference_fast" in safety.off,
            f"experiment.{dof.label}.period",
            sine.period,
            f"at least {least_period:.3g}: safety.reference_speed limits faster references",
        )
    for dof, noise in zip(Dof, safety.state_noise, strict=True):
        tolerance = dofs[dof].contact_tolerance * dofs[dof].update_distance
        _require(
            0 <= 3 * noise < tolerance,
            f"safety.state_noise[{dof}]",
            noise,
            f"less than a third of {dof.label}.contact_tolerance times "
            f"{dof.label}.update_distance = {tolerance:.3g}",
        )


def check_drives(drives: DrivesConfig) -> None:
    """The relations in block ``drives``, and the ranges that CANopen can express."""
    taken = {drives.master_node: "master_node"}
    for dof in Dof:
        axis, path = drives[dof], f"drives.{dof.label}"
        owner = taken.get(axis.node)
        _require(owner is None, f"{path}.node", axis.node, f"not that of drives.{owner}")
        taken[axis.node] = dof.label
        _require(axis.travel[0] < axis.travel[1], f"{path}.travel", axis.travel, _RANGE)
        _require(
            max(abs(end - axis.home) for end in axis.travel) * axis.counts_per_unit < 2**31,
            f"{path}.counts_per_unit",
            axis.counts_per_unit,
            f"less than 2^31 counts over the travel {axis.travel}",
        )
        _require_at_most(path, axis, "following_window", "following_error")
        _require(
            axis.speed_limit * drives.cycle * axis.counts_per_unit >= 1,
            f"{path}.counts_per_unit",
            axis.counts_per_unit,
            "at least one count per cycle at the speed limit; per m or rad, not mm or deg",
        )
    for name, most in (
        ("cycle", 0.255),
        ("heartbeat_period", 65.535),
        ("heartbeat_timeout", 65.535),
        ("following_timeout", 65.535),
    ):
        value = getattr(drives, name)
        is_whole = math.isclose(value * 1e3, round(value * 1e3))
        allowed = f"whole milliseconds, 0.001 to {most}"
        _require(0.001 <= value <= most and is_whole, f"drives.{name}", value, allowed)
    reply, cycle = drives.reply_timeout, drives.cycle
    _require(reply < cycle, "drives.reply_timeout", reply, f"less than drives.cycle = {cycle}")
    least = 2 * max(drives.heartbeat_period, cycle)
    _require(
        drives.heartbeat_timeout >= least,
        "drives.heartbeat_timeout",
        drives.heartbeat_timeout,
        f"at least {least}: two heartbeats and two cycles",
    )


def _require(is_valid: bool, field: str, value: object, allowed: str) -> None:
    if not is_valid:
        raise ConfigError(field, value, allowed)


def _require_names(field: str, names: Sequence[str], allowed: Sequence[str]) -> None:
    for index, name in enumerate(names):
        _require(name in allowed, f"{field}[{index}]", name, "one of " + ", ".join(allowed))


def _require_at_most(path: str, block: object, name: str, limit_name: str) -> None:
    value, limit = getattr(block, name), getattr(block, limit_name)
    _require(value <= limit, f"{path}.{name}", value, f"at most {path}.{limit_name} = {limit}")
