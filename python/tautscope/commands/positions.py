"""Options that read positions of the three DOFs: a file, and the units of its columns."""

from __future__ import annotations

import argparse

import numpy as np
from numpy.typing import NDArray

from tautscope.config import Config
from tautscope.dof import Dof
from tautscope.errors import FieldError, RecordError
from tautscope.loop.references import RecordedReference
from tautscope.runs.records import read_motors
from tautscope.runs.units import parse_units

Floats = NDArray[np.float64]

LARGEST_WORKSPACES = 3.0
"""Positions beyond so many workspaces of the experiment are in another unit."""


def add_units(parser: argparse.ArgumentParser) -> None:
    """``--units``."""
    parser.add_argument(
        "--units",
        default="",
        metavar="COL=UNIT,...",
        help="units of these columns: insertion=mm,rotation=deg,bending=deg,time=ms "
        "[those of the titles, else s, m, rad]",
    )


def add_reference(parser: argparse.ArgumentParser, replaces: str) -> None:
    """``--reference`` and ``--units``."""
    parser.add_argument(
        "--reference",
        metavar="FILE",
        help="recorded motion of an operator: CSV or Parquet with columns time, insertion, "
        f"rotation, bending; - reads standard input [{replaces}]",
    )
    add_units(parser)


def read_positions(path: str, units: str, config: Config) -> tuple[Floats, Floats]:
    """Time (n,) [s] and positions (n, 3) [m, rad, rad], see `read_motors`."""
    sines = [config.experiment[dof] for dof in Dof]
    largest = [LARGEST_WORKSPACES * (abs(sine.centre) + sine.amplitude) for sine in sines]
    return read_motors(path, parse_units(units), np.array(largest))


def read_reference(options: argparse.Namespace, config: Config) -> RecordedReference | None:
    """The motion of ``--reference``; None without the option.

    Raises:
        FieldError: ``--units`` without ``--reference``.
        RecordError: The file cannot be used, or a position is outside the drives' travel.
    """
    if options.reference is None:
        if options.units:
            raise FieldError(
                "--units", options.units, "a file, --reference FILE, that it describes"
            )
        return None
    time, positions = read_positions(options.reference, options.units, config)
    if len(time) < 2:
        raise RecordError(str(options.reference), f"{len(time)} line", "at least 2")
    if config.drives is not None:
        for dof in Dof:
            lower, upper = config.drives[dof].travel
            farthest = max(positions[:, dof], key=lambda each: max(lower - each, each - upper))
            if not lower <= farthest <= upper:
                where = f"{options.reference}, column {dof.label}"
                allowed = f"{lower:g} to {upper:g}, drives.{dof.label}.travel"
                raise RecordError(where, float(farthest), allowed)
    return RecordedReference(time, positions, config)
