"""The ``tautscope`` command."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence

from tautscope._core import __version__
from tautscope.commands import analyze, arguments, bench, demo, doctor, hardware, log
from tautscope.config import dump_config, load_config
from tautscope.errors import TautscopeError


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command. Exit status: 0 success, 2 an error of the user, 130 interrupted.

    `replay` returns 1 if an output differs from the recorded one, `doctor` if something is missing.
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
        description="Hysteresis compensation for robotic flexible endoscopic instruments, from the "
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
        description="Print the configuration as TOML, with all defaults.",
    )
    arguments.add_config(config)
    config.set_defaults(run=_config)


def _config(options: argparse.Namespace) -> None:
    print(dump_config(load_config(options.config)), end="")
