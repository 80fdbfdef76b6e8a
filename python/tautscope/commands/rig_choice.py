"""The rig that the options of a command name: the only place that chooses one."""

import argparse
from collections.abc import Callable

from tautscope.commands.arguments import article_config
from tautscope.config import Config, load_config
from tautscope.config.placeholders import refuse_placeholders
from tautscope.console.paced_rig import PacedRig
from tautscope.errors import ConfigError, FieldError
from tautscope.loop.rig import Rig
from tautscope.runs.rigs import rig_maker

ROBOTS = {"colonoscope": "tautscope.twin.colonoscope:ColonoscopeTwin"}
"""Simulated robots other than the article's instrument; each has a shipped configuration."""


def add_rig(parser: argparse._ActionsContainer, help: str, *, required: bool = False) -> None:
    """``--rig``."""
    help += "; an entry point of tautscope.rigs, or a class: docs/robots.md"
    parser.add_argument("--rig", metavar="MODULE:CLASS", required=required, help=help)


def add_robot(parser: argparse.ArgumentParser, help: str) -> None:
    """``--robot``."""
    parser.add_argument("--robot", choices=list(ROBOTS), help=help)


def choose_rig(
    options: argparse.Namespace, *, in_real_time: bool = False
) -> tuple[Config, Callable[[Config], Rig]]:
    """The configuration, and what makes a rig of it.

    That of ``--rig``; with ``--robot`` a simulated robot; with ``--twin`` the article's instrument,
    simulated in real time; else the drives and the camera of the configuration.

    With `in_real_time` the steps of ``--rig`` and ``--robot`` take a control period, and each reset
    makes the rig anew; drives do so by themselves.

    Raises:
        ConfigError: The configuration does not describe such a rig.
        FieldError: ``--robot`` without ``--twin``, of a command that has it.
    """
    names = ("rig", "robot", "twin", "profile", "seed")
    rig, robot, is_twin, profile, seed = (getattr(options, name, None) for name in names)
    if robot is not None and is_twin is False:
        raise FieldError("--robot", robot, "--twin beside it")
    if robot is not None:
        make = rig_maker(ROBOTS[robot], seed=seed or 0)
    elif rig is not None:
        make = rig_maker(rig)
    else:
        config = article_config(options.config, profile)
        if is_twin:
            from tautscope.console.live_twin import LiveTwin  # noqa: PLC0415  MuJoCo

            return config.replace(drives=None), LiveTwin
        from tautscope.hardware.rig import HardwareRig  # noqa: PLC0415

        if options.config is None or config.drives is None:
            allowed = "a section [drives], or another rig by an option: --help"
            raise ConfigError("drives", None, allowed)
        refuse_placeholders(options.config)
        return config, HardwareRig
    config = load_config(options.config or robot, profile)
    if not in_real_time:
        return config, make
    if not is_twin:
        refuse_placeholders(options.config)
    period = config.control.period
    return config, lambda used: PacedRig(lambda: make(used), period, is_simulated=bool(is_twin))


def rig_in_words(options: argparse.Namespace) -> str:
    """The rig of ``--twin``, ``--rig`` or the drives, for messages."""
    return "the twin" if options.twin else f"REAL MOTORS of {options.rig or options.config}"
