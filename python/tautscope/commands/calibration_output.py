"""Options that every kind of ``tautscope calibrate`` has, and the output of its result."""

import argparse
from pathlib import Path

from tautscope.calibration.result import CalibrationResult
from tautscope.commands import arguments
from tautscope.commands.printing import print_json
from tautscope.config.edit import edited_text, writable_file, write_values
from tautscope.errors import FieldError
from tautscope.runs.output_folder import check_free, check_writable, new_folder


def add_options(parser: argparse.ArgumentParser) -> None:
    """``--config``, ``--write``, ``--out``, ``--json``."""
    arguments.add_config(parser)
    parser.add_argument(
        "--write",
        action="store_true",
        help="write the values into the file of --config, with date, serial numbers and standard "
        "deviations; without it they are printed",
    )
    parser.add_argument(
        "--out",
        type=Path,
        metavar="DIR",
        help="also write a folder, new or empty, with values.toml and the figures",
    )
    arguments.add_json(parser)


def check_options(options: argparse.Namespace, *, reads_config: bool = True) -> None:
    """Check before anything runs that the results can be written.

    Args:
        options: With those of `add_options`.
        reads_config: Whether ``--config`` is more than the file of ``--write``.

    Raises:
        FieldError: ``--write`` without ``--config``, or ``--config`` without an effect.
        OutputError: The folder is taken or cannot be written.
    """
    if options.write:
        if options.config is None:
            raise FieldError("--write", True, "also --config FILE, the file to write to")
        check_writable(writable_file(options.config))
    elif not reads_config:
        arguments.refuse_unused(options, "also --write, or no files", "config")
    if options.out is not None:
        check_free(options.out)


def finish(options: argparse.Namespace, result: CalibrationResult) -> None:
    """Print and write a result as the options say; printed first, no error loses it."""
    changes = result.changes()
    text = edited_text("", changes)
    values = {key: value for key, value in changes.items() if not key.startswith("calibration.")}
    record = changes[f"calibration.{result.kind}"]
    notes = list(result.notes)
    print_json(options, {"values": values, **record, **result.data, "notes": notes})
    print(text, end="")
    for note in result.notes:
        print(f"# {note}")
    if options.write:
        write_values(options.config, changes)
        print(f"# written: {options.config}")
    if options.out is not None:
        with new_folder(options.out) as partial:
            (partial / "values.toml").write_text(text, encoding="utf-8")
            for k, (figure, _) in enumerate(result.figures, 1):
                number = f"_{k}" if len(result.figures) > 1 else ""
                figure.savefig(partial / f"{result.kind}{number}.png", dpi=150)
