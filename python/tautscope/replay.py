"""Users import records and their prediction from here; the code is in `tautscope.runs.replay`."""

from tautscope.runs.replay import (
    Cleaning,
    Record,
    predict_tip,
    read_motors,
    read_record,
)

__all__ = [
    "Cleaning",
    "Record",
    "predict_tip",
    "read_motors",
    "read_record",
]
