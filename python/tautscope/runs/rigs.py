"""Rigs of the user, by name."""

import inspect
import math
from collections.abc import Callable
from importlib.metadata import entry_points
from typing import Any

from tautscope.config import Config
from tautscope.errors import ConfigError
from tautscope.loop.actuators import with_actuators
from tautscope.loop.named_class import named_class
from tautscope.loop.rig import Rig

GROUP = "tautscope.rigs"
"""Entry points of this group are rigs by their names."""


def rig_maker(name: str, **arguments: Any) -> Callable[[Config], Rig]:
    """What makes the rig of a name: ``module:Class``, or an entry point of `GROUP`.

    The class is called with `arguments`, and with the configuration if its constructor needs an
    argument, or has one named config.

    Raises:
        ConfigError: There is none of this name, or what it makes is no `Rig`.
    """
    field, allowed = "rig", f'"module:Class", or the name of an entry point "{GROUP}"'
    found = next(iter(entry_points(group=GROUP, name=name)), None)
    try:
        made = named_class(field, name, allowed) if found is None else found.load()
    except (ImportError, AttributeError) as error:
        raise ConfigError(field, name, f"{allowed} ({error})") from None
    try:
        parameters = inspect.signature(made).parameters.values()
    except (TypeError, ValueError):
        raise ConfigError(field, name, "a class of yours, with control_period") from None

    variable = (inspect.Parameter.VAR_POSITIONAL, inspect.Parameter.VAR_KEYWORD)
    takes_config = any(
        each.name == "config" or (each.default is each.empty and each.kind not in variable)
        for each in parameters
    )

    def make(config: Config) -> Rig:
        rig = made(*([config] if takes_config else []), **arguments)
        parts = ("control_period", "reset", "step", "close")
        missing = [part for part in parts if not hasattr(rig, part)]
        if missing:
            raise ConfigError(field, name, f"a rig with {', '.join(missing)}: tautscope.Rig")
        period = config.control.period
        if not math.isclose(rig.control_period, period, rel_tol=1e-6):
            rig.close()
            allowed = f"that of the rig, {rig.control_period:g} s"
            raise ConfigError("control.period", period, allowed)
        return with_actuators(rig, config)

    return make
