"""Options and number types that several verbs share."""

import argparse
import math
import re
from collections.abc import Callable, Sequence
from os import PathLike
from pathlib import Path
from typing import TypeAlias, get_args

from tautscope.config import RIGS, Config, Profile, load_config
from tautscope.errors import ConfigError, FieldError
from tautscope.runs.output_folder import check_free, default_folder

_NEGATIVE = re.compile(r"-(\d+\.?\d*|\.\d+)(e[-+]?\d+)?$", re.IGNORECASE)
_LARGEST = 1e100
"""Of numbers, as of the cells of a table."""
Verbs: TypeAlias = "argparse._SubParsersAction[argparse.ArgumentParser]"


def add_verb(
    verbs: Verbs,
    name: str,
    run: Callable[[argparse.Namespace], int | None] | None = None,
    *,
    help: str,
    description: str,
    extras: Sequence[str] = (),
) -> argparse.ArgumentParser:
    """Add a verb to the command line.

    Args:
        verbs: The verbs so far.
        name: Its name.
        run: What it does with its options; the exit status. None of a verb with verbs of its own.
        help: One line for the list of verbs.
        description: Text of its own ``--help``.
        extras: Extras of the package that it needs; `tautscope.cli.main` checks them first.
    """
    parser = verbs.add_parser(name, allow_abbrev=False, help=help, description=description)
    # Of itself argparse takes a negative number with an exponent for an option.
    parser._negative_number_matcher = _NEGATIVE
    parser.set_defaults(
        run=run, extras=tuple(extras), usage_error=parser.error, default_of=parser.get_default
    )
    add_verbose(parser, default=argparse.SUPPRESS)
    return parser


def add_verbose(parser: argparse.ArgumentParser, default: int | str = 0) -> None:
    """``-v``, before or after the verb."""
    parser.add_argument(
        "-v",
        "--verbose",
        action="count",
        default=default,
        help="print what is done; -vv prints details",
    )


def refuse_unused(options: argparse.Namespace, allowed: str, *names: str) -> None:
    """Refuse options that would have no effect.

    Args:
        options: Of a verb.
        allowed: What they need beside them, for the error.
        names: Their attributes; a verb may lack some.

    Raises:
        FieldError: One of them has another value than by default.
    """
    for name in names:
        value = getattr(options, name, None)
        if value != options.default_of(name):
            shown = str(value) if isinstance(value, Path) else value
            raise FieldError(f"--{name.replace('_', '-')}", shown, allowed)


def add_config(
    parser: argparse.ArgumentParser, *, required: bool = False, default: str | None = None
) -> None:
    """``--config``."""
    shown = "" if default is None else " [%(default)s]"
    parser.add_argument(
        "--config",
        required=required,
        default=default,
        metavar="FILE",
        help="TOML file, or the name of a shipped one: "
        f"{', '.join(RIGS)}; missing keys have their defaults{shown}",
    )


def article_config(
    path: str | PathLike[str] | None = None, profile: Profile | None = None
) -> Config:
    """As `load_config`, of the article's instrument, which most commands are for.

    Raises:
        ConfigError: As `load_config`; the configuration has [[dof]].
    """
    config = load_config(path, profile)
    if config.dof:
        found = ", ".join(dof.name for dof in config.dof)
        other = "docs/robots.md has what other robots use"
        raise ConfigError("dof", found, f"none: this is for the article's instrument. {other}")
    return config


def add_profile(parser: argparse.ArgumentParser, what: str) -> None:
    """``--profile``; `what` describes its effect."""
    parser.add_argument(
        "--profile", choices=get_args(Profile), help=f"{what} [that of the configuration]"
    )


def add_out(parser: argparse.ArgumentParser, verb: str) -> None:
    """``--out``, see `out_folder`."""
    parser.add_argument(
        "--out",
        type=Path,
        metavar="DIR",
        help=f"output folder, new or empty [runs/<date-time>-{verb}]",
    )


def out_folder(options: argparse.Namespace) -> Path:
    """The folder of ``--out``, or one with date and verb in its name; it can be written.

    Raises:
        OutputError: It is not empty, or cannot be written.
    """
    return check_free(options.out or default_folder(options.verb))


def add_json(parser: argparse.ArgumentParser) -> None:
    """``--json``."""
    parser.add_argument(
        "--json", action="store_true", help="print one JSON object only, in one line"
    )


def _integer(least: int) -> Callable[[str], int]:
    def parse(text: str) -> int:
        if not text.isdecimal() or int(text) < least:
            what = f"got {text!r}, expected an integer of at least {least}"
            raise argparse.ArgumentTypeError(what)
        return int(text)

    return parse


def _number(
    expected: str, is_allowed: Callable[[float], bool] = math.isfinite
) -> Callable[[str], float]:
    """What reads a finite number that is allowed."""

    def parse(text: str) -> float:
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not (math.isfinite(value) and is_allowed(value)):
            raise argparse.ArgumentTypeError(f"got {text!r}, expected {expected}")
        return value

    return parse


natural, positive = _integer(0), _integer(1)
above_zero = _number("a number above 0", lambda value: value > 0)
not_zero = _number(
    "a number other than 0, of a magnitude of 1e-100 to 1e100",
    lambda value: 1 / _LARGEST <= abs(value) <= _LARGEST,
)
seconds = _number("a number of seconds")
