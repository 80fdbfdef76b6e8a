"""What is refused, and how it is named."""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING, Any

import msgspec

from tautscope._core import DETECTORS
from tautscope.config.twin import DISTURBANCES
from tautscope.dof import Dof
from tautscope.errors import ConfigError

if TYPE_CHECKING:
    from tautscope.config.drives import DrivesConfig
    from tautscope.config.root import Config


def refusal(error: msgspec.ValidationError, document: dict[str, Any]) -> ConfigError:
    """The library's error as ours.

    It says what and where; the value that came is looked up in the document.
    """
    message = str(error)
    expected, _, path = message.partition(" - at `$")
    path = path.rstrip("`").lstrip(".")
    unknown = re.search(r"unknown field `([^`]*)`", expected)
    missing = re.search(r"missing required field `([^`]*)`", expected)
    for named in (unknown, missing):
        if named:
            path = f"{path}.{named[1]}".lstrip(".")
    value: Any = document
    for key in re.findall(r"[^.\[\]]+", path):
        try:
            value = value[int(key)] if isinstance(value, list | tuple) else value[key]
        except (KeyError, TypeError, IndexError, ValueError):
            value = None
            break
    if unknown:
        allowed = "no such key; `tautscope config` prints those there are"
    elif missing:
        allowed = "a value: it has no default"
    else:
        allowed = expected.removeprefix("Expected ").split(", got")[0].replace("`", "")
    return ConfigError(path or "config", value, allowed)


def check_finite(value: Any, path: str) -> None:
    """TOML has nan and inf, which ranges let pass; here no number may be either.

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


def check_relations(config: Config) -> None:
    """What no single field can check.

    Raises:
        ConfigError: Names the first field that does not go with another.
    """
    for dof in Dof:
        settings = config[dof]
        if settings.free_gain > settings.gain_limit:
            raise ConfigError(
                f"{dof.label}.free_gain",
                settings.free_gain,
                f"at most {dof.label}.gain_limit = {settings.gain_limit}",
            )
        if settings.delta_minus > settings.delta_plus:
            raise ConfigError(
                f"{dof.label}.delta_minus",
                settings.delta_minus,
                f"at most {dof.label}.delta_plus = {settings.delta_plus}",
            )
    adaptive = config.adaptive
    if adaptive.cautious_gain > adaptive.contact_gain:
        raise ConfigError(
            "adaptive.cautious_gain",
            adaptive.cautious_gain,
            f"at most adaptive.contact_gain = {adaptive.contact_gain}",
        )
    instrument = config.instrument
    half = instrument.band_length / 2
    if not half <= instrument.marker_a <= instrument.marker_b - 2 * half:
        raise ConfigError(
            "instrument.marker_a",
            instrument.marker_a,
            "a band on the tip, wholly proximal of marker_b's band",
        )
    if instrument.marker_b + half > instrument.tip_length:
        raise ConfigError(
            "instrument.marker_b", instrument.marker_b, "a band that ends before the tip does"
        )
    twin = config.twin
    if twin.latency_jitter > twin.latency:
        raise ConfigError(
            "twin.latency_jitter", twin.latency_jitter, f"at most twin.latency = {twin.latency}"
        )
    for index, name in enumerate(twin.disturb):
        if name not in DISTURBANCES:
            raise ConfigError(f"twin.disturb[{index}]", name, "one of " + ", ".join(DISTURBANCES))
    ticks = config.control.history / config.control.period
    if not 1 <= ticks <= 1024:
        raise ConfigError(
            "control.history",
            config.control.history,
            f"1 to 1024 ticks of control.period = {config.control.period}",
        )
    _check_safety(config)
    if config.drives is not None:
        _check_drives(config.drives)


def _check_safety(config: Config) -> None:
    safety = config.safety
    for index, name in enumerate(safety.off):
        if name not in DETECTORS:
            raise ConfigError(f"safety.off[{index}]", name, "one of " + ", ".join(DETECTORS))
    for index, (least, largest) in enumerate(safety.command_travel):
        if least >= largest:
            raise ConfigError(
                f"safety.command_travel[{index}]",
                (least, largest),
                "the lesser end, then the larger",
            )
    for dof, speed in zip(Dof, safety.reference_speed, strict=True):
        sine = config.experiment[dof]
        least_period = 2 * math.pi * sine.amplitude / speed
        if sine.period < least_period and "reference_jump" not in safety.off:
            raise ConfigError(
                f"experiment.{dof.label}.period",
                sine.period,
                f"at least {least_period:.3g}; a faster hand is stopped, safety.reference_speed",
            )
    for dof, noise in zip(Dof, safety.state_noise, strict=True):
        tolerated = config[dof].contact_tolerance * config[dof].update_distance
        if not 0 <= 3 * noise < tolerated:
            raise ConfigError(
                f"safety.state_noise[{dof}]",
                noise,
                f"three of it below {dof.label}.contact_tolerance times "
                f"{dof.label}.update_distance = {tolerated:.3g}",
            )


def _check_drives(drives: DrivesConfig) -> None:
    taken = {drives.master_node: "master_node"}
    for dof in Dof:
        axis, path = drives[dof], f"drives.{dof.label}"
        if axis.node in taken:
            raise ConfigError(f"{path}.node", axis.node, f"not that of drives.{taken[axis.node]}")
        taken[axis.node] = dof.label
        lower, upper = axis.travel
        if lower >= upper:
            raise ConfigError(f"{path}.travel", axis.travel, "the lesser end, then the larger")
        if max(abs(end - axis.home) for end in axis.travel) * axis.counts_per_unit >= 2**31:
            raise ConfigError(
                f"{path}.counts_per_unit",
                axis.counts_per_unit,
                f"less than 2^31 counts over the travel {axis.travel}",
            )
        if axis.following_window > axis.following_error:
            raise ConfigError(
                f"{path}.following_window",
                axis.following_window,
                f"at most {path}.following_error = {axis.following_error}",
            )
        step = axis.speed_limit * drives.cycle * axis.counts_per_unit
        if step < 1:
            raise ConfigError(
                f"{path}.counts_per_unit",
                axis.counts_per_unit,
                "a count or more per cycle at the speed limit: counts per m or rad, not mm or deg",
            )
    for name, most in (
        ("cycle", 0.255),
        ("heartbeat_period", 65.535),
        ("heartbeat_timeout", 65.535),
        ("following_timeout", 65.535),
    ):
        value = getattr(drives, name)
        if not (0.001 <= value <= most and math.isclose(value * 1e3, round(value * 1e3))):
            raise ConfigError(f"drives.{name}", value, f"whole milliseconds, 0.001 to {most}")
    if drives.reply_timeout >= drives.cycle:
        raise ConfigError(
            "drives.reply_timeout", drives.reply_timeout, f"less than drives.cycle = {drives.cycle}"
        )
    least = 2 * max(drives.heartbeat_period, drives.cycle)
    if drives.heartbeat_timeout < least:
        raise ConfigError(
            "drives.heartbeat_timeout",
            drives.heartbeat_timeout,
            f"at least {least}: two heartbeats and two cycles",
        )
