"""The ``tautscope`` command."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence

from tautscope._core import __version__
from tautscope.bench import commands as bench
from tautscope.commands import analyze, arguments, demo
from tautscope.config import dump_config, load_config
from tautscope.errors import TautscopeError
from tautscope.hardware import commands as hardware
from tautscope.hardware.doctor import commands as doctor
from tautscope.log import commands as log


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; 0 on success, 2 on an error a person can mend, 130 when interrupted.

    `replay` returns 1 if the outputs were others than those recorded, `doctor` if something is
    missing.
    """
    options = _parser().parse_args(arguments)
    try:
        return options.run(options) or 0
    except TautscopeError as error:
        print("\n".join([f"error: {error}", *getattr(error, "__notes__", ())]), file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("interrupted; nothing was written", file=sys.stderr)
        return 130


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="tautscope",
        description="Takes the slack out of robotic flexible endoscopic instruments, using the "
        "endoscope's own images. Research software, not a medical device.",
        allow_abbrev=False,
    )
    parser.add_argument("--version", action="version", version=f"tautscope {__version__}")
    verbs = parser.add_subparsers(dest="verb", required=True, metavar="VERB")
    demo.add_parser(verbs)
    _add_config_parser(verbs)
    analyze.add_parser(verbs)
    log.add_parsers(verbs)
    hardware.add_parser(verbs)
    bench.add_parser(verbs)
    doctor.add_parser(verbs)
    return parser


def _add_config_parser(verbs: arguments.Verbs) -> None:
    config = verbs.add_parser(
        "config",
        allow_abbrev=False,
        help="print the configuration",
        description="Print the configuration as TOML, every default written out.",
    )
    arguments.add_config(config)
    config.set_defaults(run=_config)


def _config(options: argparse.Namespace) -> None:
    print(dump_config(load_config(options.config)), end="")
