"""The rig that a calibration moves: drives and camera of a configuration, or the twin."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING

from tautscope.commands import arguments
from tautscope.commands.article_config import article_config
from tautscope.commands.question import confirm
from tautscope.config import Config
from tautscope.config.placeholders import MARK, placeholders
from tautscope.errors import ConfigError, FieldError
from tautscope.extras import require_extras

if TYPE_CHECKING:
    from tautscope.loop.rig import Rig
    from tautscope.runs.recording import Recording


@dataclass(frozen=True)
class Setup:
    """A rig and its configuration.

    Attributes:
        rig: To be moved; it is closed with the block.
        config: What is known of it.
        serial_numbers: Of camera and drives, where they have one.
    """

    rig: Rig
    config: Config
    serial_numbers: Mapping[str, str]


def add_rig_options(parser: argparse.ArgumentParser) -> None:
    """``--twin``, ``--seed``, ``--yes``."""
    parser.add_argument(
        "--twin",
        action="store_true",
        help="calibrate a simulated rig that differs from --config, see --seed",
    )
    parser.add_argument(
        "--seed",
        type=arguments.natural,
        metavar="N",
        help="seed of the twin and of its differences [twin.seed of the configuration]",
    )
    parser.add_argument("--yes", action="store_true", help="move the motors without asking")


def actual_rig(config: Config, seed: int | None) -> Config:
    """The configuration of the twin: it differs from `config` as drawn with the seed."""
    from tautscope.twin.drawn_rig import draw_rig  # noqa: PLC0415

    return draw_rig(config, config.twin.seed if seed is None else seed)


@contextmanager
def rig_for_calibration(options: argparse.Namespace) -> Iterator[Setup]:
    """Open the rig of the options, and close it at the end.

    Raises:
        FieldError: Neither ``--config`` with drives nor ``--twin`` is given, or the question
            whether the motors may move is not answered with y.
        TautscopeError: Errors of the rig.
    """
    config = article_config(options.config)
    if options.twin:
        require_extras("--twin", ["twin"])
        from tautscope.twin.rig import Twin  # noqa: PLC0415

        twin = Twin(actual_rig(config, options.seed))
        try:
            yield Setup(twin, config, {})
        finally:
            twin.close()
        return
    if options.config is None:
        raise FieldError("files", None, "files, --config FILE of a rig, or --twin")
    confirm_motion(options)
    with open_rig(config) as setup:
        yield setup


def simulated_experiment(
    options: argparse.Namespace,
    config: Config,
    progress: Callable[[float], None],
    *,
    compensate: bool = True,
) -> Recording:
    """Run the sines of a configuration on the twin of the options.

    Args:
        options: With those of `add_rig_options`, and ``--twin``.
        config: Of the loop.
        progress: Called with the share of the motion done.
        compensate: Whether the hysteresis is compensated.
    """
    from tautscope.loop.references import SineSequence  # noqa: PLC0415
    from tautscope.runs.experiment import run_experiment  # noqa: PLC0415

    with rig_for_calibration(options) as setup:
        return run_experiment(
            setup.rig,
            SineSequence(config.experiment),
            config,
            compensate,
            progress=lambda elapsed, duration: progress(elapsed / duration),
        )


@contextmanager
def open_rig(config: Config) -> Iterator[Setup]:
    """Open drives and camera; on every exit the motors are quick-stopped."""
    from tautscope.hardware.rig import HardwareRig, require_drives  # noqa: PLC0415
    from tautscope.hardware.serial_numbers import read_serial_numbers  # noqa: PLC0415
    from tautscope.hardware.signals import exit_on_signals  # noqa: PLC0415

    require_drives(config)
    with exit_on_signals():
        serials = read_serial_numbers(config)
        rig = HardwareRig(config)
        try:
            yield Setup(rig, config, serials)
        finally:
            rig.close()


def refuse_wrong_limits(config: str) -> None:
    """Refuse a configuration in which values of the drives are placeholders.

    Raises:
        ConfigError: Names the keys.
    """
    marked = [key for key in placeholders(config) if key.startswith("drives.")]
    if marked:
        allowed = f"your values, and lines without the word {MARK}: the motors would move wrongly"
        raise ConfigError(", ".join(marked), f"placeholders of {config}", allowed)


def confirm_motion(options: argparse.Namespace) -> None:
    """Ask whether the motors may move, unless ``--yes``.

    Raises:
        ConfigError: The limits of the drives are placeholders.
        FieldError: The answer is not y.
    """
    refuse_wrong_limits(options.config)
    question = (
        "THE MOTORS WILL MOVE, in the range of [experiment]. Hold the scope still, keep tissue and "
        "hands away, the emergency stop within reach."
    )
    confirm(question, options, article_config(options.config).camera)
