"""Rigs of the user, by name."""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable
from importlib.metadata import entry_points

from tautscope.config import Config
from tautscope.errors import ConfigError
from tautscope.loop.named_class import named_class
from tautscope.loop.rig import Rig

GROUP = "tautscope.rigs"
"""Entry points of this group are rigs by their names."""


def rig_maker(name: str) -> Callable[[Config], Rig]:
    """What makes the rig of a name: ``module:Class``, or an entry point of `GROUP`.

    The class is called with the configuration if its constructor takes an argument, else without.

    Raises:
        ConfigError: There is none of this name, or what it makes is no `Rig`.
    """
    field, allowed = "rig", f'"module:Class", or the name of an entry point "{GROUP}"'
    found = entry_points(group=GROUP, name=name)
    made = next(iter(found)).load() if found else named_class(field, name, allowed)
    try:
        takes_config = bool(inspect.signature(made).parameters)
    except (TypeError, ValueError):
        raise ConfigError(field, name, "a class of yours, with control_period") from None

    def make(config: Config) -> Rig:
        rig = made(config) if takes_config else made()
        missing = [part for part in _PARTS if not hasattr(rig, part)]
        if missing:
            raise ConfigError(field, name, f"a rig with {', '.join(missing)}: tautscope.Rig")
        period = config.control.period
        if not math.isclose(rig.control_period, period, rel_tol=1e-6):
            allowed = f"that of the rig, {rig.control_period:g} s"
            raise ConfigError("control.period", period, allowed)
        return rig  # type: ignore[no-any-return]

    return make


_PARTS = ("control_period", "reset", "step", "close")
