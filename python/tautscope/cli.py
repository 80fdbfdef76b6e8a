"""The ``tautscope`` command."""

import argparse
import errno
import io
import logging
import os
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, redirect_stdout

from tautscope._core import __version__
from tautscope.commands import (
    align,
    analyze,
    arguments,
    bench,
    calibrate,
    config,
    console,
    demo,
    doctor,
    jog,
    log,
    report,
    ros2,
    run,
)
from tautscope.errors import USAGE, TautscopeError, notes
from tautscope.extras import require_extras
from tautscope.hardware.signals import TERMINATING, exit_on_termination

INTERRUPTED, CLOSED_PIPE = 128 + 2, 128 + 13
"""Exit status after SIGINT and SIGPIPE, as of a shell."""
_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO)
"""Errors of writing, which have no name of a file."""
TERMINATED = tuple(128 + number for number in TERMINATING)
"""After SIGTERM and SIGHUP."""
_STATUS = """exit status:
  0    success
  1    the result is negative: replay differs, align has no answer, something is missing or no use
  2    bad input: options, files, configuration, a missing extra
  3    refused by the rig: bus, drive or camera; the loop has not begun
  4    stopped for safety: the motors are stopped, or motion of the loop is held
  130  interrupted, 141 output pipe closed, 143 terminated
"""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; its exit status, see ``tautscope --help``."""
    # A closed stream is None, to which nothing can be printed.
    sys.stdout, sys.stderr = (each or io.StringIO() for each in (sys.stdout, sys.stderr))
    try:
        try:
            return _main(arguments)
        finally:
            sys.stdout.flush()
    except OSError as error:
        is_closed = isinstance(error, BrokenPipeError)
        if not is_closed and error.errno not in _FULL:
            raise
        # The interpreter flushes again when it ends.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        if is_closed:
            return CLOSED_PIPE
        print(f"error: the output cannot be written: {error.strerror}", file=sys.stderr)
        return USAGE


def _main(arguments: Sequence[str] | None) -> int:
    parser = _parser()
    if "_ARGCOMPLETE" in os.environ:
        import argcomplete  # noqa: PLC0415  only the shell's completion needs it

        argcomplete.autocomplete(parser)
    options, unknown = parser.parse_known_args(arguments)
    if unknown:
        # The verb's own usage lists its options; the parser above it would list the verbs.
        options.usage_error(f"unrecognized arguments: {' '.join(unknown)}")
    try:
        options.stdout = sys.stdout
        people = io.StringIO() if getattr(options, "json", False) else sys.stdout
        with _logging(options.verbose), redirect_stdout(people), exit_on_termination():
            require_extras(f"tautscope {options.verb}", options.extras)
            return options.run(options) or 0
    except TautscopeError as error:
        print("\n".join([f"error: {error}", *notes(error)]), file=sys.stderr)
        return error.exit_status
    except KeyboardInterrupt as stop:
        print("\n".join(["interrupted", *notes(stop)]), file=sys.stderr)
        return INTERRUPTED
    except SystemExit as stop:
        if not isinstance(stop.code, int) or stop.code not in TERMINATED:
            raise  # argparse has printed why
        print("\n".join(["terminated", *notes(stop)]), file=sys.stderr)
        return stop.code
    except OSError as error:
        if error.filename is None:
            raise
        text = f"error: {error.filename}: {error.strerror}"
        print("\n".join([text, *notes(error)]), file=sys.stderr)
        return USAGE


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="tautscope",
        description="Hysteresis compensation for robotic flexible endoscopic instruments, from the "
        "endoscope's own images.\nResearch software, not a medical device.",
        epilog=_STATUS,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    parser.add_argument("--version", action="version", version=f"tautscope {__version__}")
    arguments.add_verbose(parser)
    verbs = parser.add_subparsers(dest="verb", required=True, metavar="COMMAND")
    demo.add_parser(verbs)
    config.add_parser(verbs)
    analyze.add_parser(verbs)
    log.add_parsers(verbs)
    report.add_parser(verbs)
    align.add_parser(verbs)
    run.add_parser(verbs)
    console.add_parser(verbs)
    ros2.add_parser(verbs)
    bench.add_parser(verbs)
    doctor.add_parser(verbs)
    calibrate.add_parser(verbs)
    jog.add_parser(verbs)
    return parser


@contextmanager
def _logging(verbosity: int) -> Iterator[None]:
    """Print the log of the package on stderr: warnings, with ``-v`` more."""

    class Formatter(logging.Formatter):
        def format(self, record: logging.LogRecord) -> str:
            return f"{record.levelname.lower()}: {record.getMessage()}"

    logger, handler = logging.getLogger("tautscope"), logging.StreamHandler()
    handler.setFormatter(Formatter())
    level = logger.level
    logger.addHandler(handler)
    logger.setLevel((logging.WARNING, logging.INFO, logging.DEBUG)[min(verbosity, 2)])
    try:
        yield
    finally:
        logger.removeHandler(handler)
        logger.setLevel(level)
