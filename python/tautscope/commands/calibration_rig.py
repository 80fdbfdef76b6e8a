"""The rig that a calibration moves: drives and camera of a configuration, or the twin."""

from __future__ import annotations

import argparse
import re
from collections.abc import Iterator, Mapping
from concurrent.futures import Executor
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tautscope.commands import arguments
from tautscope.commands.printing import progress_bar
from tautscope.commands.question import confirm
from tautscope.config import Config
from tautscope.config.calibration import TWIN
from tautscope.config.placeholders import MARK, placeholders
from tautscope.errors import ConfigError, FieldError
from tautscope.extras import require_extras
from tautscope.hardware.signals import exit_on_signals
from tautscope.loop.references import SineSequence
from tautscope.loop.rig import Rig
from tautscope.runs.experiment import run_experiment
from tautscope.runs.recording import Recording

if TYPE_CHECKING:
    from tautscope.hardware.run_results import HardwareRun

ARTICLE_MOTION = "in the range of [experiment]. Hold the scope still, keep"


@dataclass(frozen=True)
class Setup:
    """A rig, which is closed with the block, its configuration, and its devices.

    Attributes:
        serial_numbers: Of camera and drives, where they have one; the seed of the twin.
        executor: For what takes longer than a control period; None for the twin.
    """

    rig: Rig
    config: Config
    serial_numbers: Mapping[str, str]
    executor: Executor | None = None


def add_options(parser: argparse.ArgumentParser) -> None:
    """``--twin``, ``--seed``, ``--yes``."""
    add_twin(parser, "calibrate a simulated rig that differs from --config, see --seed")
    add_yes(parser)


def add_twin(parser: argparse.ArgumentParser, text: str) -> None:
    """``--twin`` and ``--seed``."""
    parser.add_argument("--twin", action="store_true", help=text)
    parser.add_argument(
        "--seed",
        type=arguments.natural,
        metavar="N",
        help="seed of the twin and of its differences [twin.seed of the configuration]",
    )


def add_yes(parser: argparse.ArgumentParser) -> None:
    """``--yes``."""
    parser.add_argument("--yes", action="store_true", help="move the motors without asking")


def check_options(options: argparse.Namespace, *, is_motion: bool = True) -> None:
    """Check ``--twin`` and ``--seed``; ``--yes`` may answer a question that is not asked.

    Without `is_motion` no rig is calibrated, but a file.
    """
    if not is_motion:
        arguments.refuse_unused(options, "no files beside it", "twin", "seed")
    elif not options.twin:
        arguments.refuse_unused(options, "--twin, whose seed it is", "seed")


def twin_seed(options: argparse.Namespace, config: Config) -> int:
    """The seed of ``--seed``, or of the configuration."""
    return int(config.twin.seed if options.seed is None else options.seed)


def twin_device(options: argparse.Namespace, config: Config) -> dict[str, str]:
    """The twin in place of the serial numbers of a rig."""
    return {TWIN: str(twin_seed(options, config))}


def twin_config(
    options: argparse.Namespace, config: Config, *, camera_is_known: bool = False
) -> Config:
    """The configuration of the simulated rig that is calibrated.

    Args:
        options: Of a calibration; with the values `drawn` once at the start of a sequence.
        config: The configuration as it is now.
        camera_is_known: As of `open_rig`.
    """
    from tautscope.twin.drawn_rig import draw_geometry, draw_rig  # noqa: PLC0415

    drawn: Mapping[str, Any] | None = getattr(options, "drawn", None)
    if drawn is not None:
        return config.replace(**drawn)
    draw = draw_geometry if camera_is_known else draw_rig
    return draw(config, twin_seed(options, config))


@contextmanager
def open_rig(options: argparse.Namespace, *, camera_is_known: bool = False) -> Iterator[Setup]:
    """Open the rig of the options, once its motors may move, and close it at the end.

    With `camera_is_known` the twin's camera is calibrated, apart from its focal lengths.
    """
    config = arguments.article_config(options.config)
    if options.twin:
        require_extras("--twin", ["twin"])
        from tautscope.twin.rig import Twin  # noqa: PLC0415

        drawn = twin_config(options, config, camera_is_known=camera_is_known)
        with closing(Twin(drawn)) as twin:
            yield Setup(twin, config, twin_device(options, config))
        return
    if options.config is None:
        raise FieldError("--config", None, "the configuration of a rig; or a file, or --twin")
    refuse_wrong_limits(options.config)
    confirm_motion(options, ARTICLE_MOTION, config)
    from tautscope.hardware.motor_rig import require_drives  # noqa: PLC0415
    from tautscope.hardware.realtime import VISION, realtime_executor  # noqa: PLC0415
    from tautscope.hardware.rig import HardwareRig  # noqa: PLC0415
    from tautscope.hardware.serial_numbers import read_serial_numbers  # noqa: PLC0415

    require_drives(config)
    # On every exit the motors are quick-stopped.
    with realtime_executor("vision", VISION) as executor, exit_on_signals():
        serial_numbers = read_serial_numbers(config)
        with closing(HardwareRig(config)) as rig:
            yield Setup(rig, config, serial_numbers, executor)


def run_protocol(
    options: argparse.Namespace, config: Config, folder: Path, title: str
) -> tuple[Recording, HardwareRun | None]:
    """Run the sines of a configuration on the rig, which logs them in a folder, or on the twin."""
    with progress_bar(title) as progress:
        if not options.twin:
            from tautscope.hardware.experiment import run_on_hardware  # noqa: PLC0415

            run = run_on_hardware(config, folder, progress)
            return run.compensated.recording, run
        with open_rig(options) as setup:
            motion = SineSequence(config.experiment)
            recording = run_experiment(
                setup.rig, motion, config, progress=lambda now, end: progress(now / end)
            )
            return recording, None


def refuse_wrong_limits(config: str | None) -> None:
    """Refuse a configuration in which values of the drives or of [[dof]] are placeholders.

    Raises:
        ConfigError: Names the keys.
    """
    marked = [key for key in placeholders(config) if re.match(r"(drives|dof)\b", key)]
    if marked:
        allowed = f"your values, and lines without the word {MARK}: the motors would move wrongly"
        raise ConfigError(", ".join(marked), f"placeholders of {config}", allowed)


def confirm_motion(options: argparse.Namespace, what: str, config: Config) -> None:
    """Ask whether the motors may move, unless ``--yes``.

    Raises:
        FieldError: The answer is not y.
    """
    text = f"{what} tissue and hands away, the emergency stop within reach."
    confirm(f"THE MOTORS WILL MOVE, {text}", options, config.camera)
