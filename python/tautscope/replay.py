"""Users import records and their prediction from here; the code is in `tautscope.runs`."""

from tautscope.runs.records import Cleaning, Record, read_motors, read_record
from tautscope.runs.replay import predict_tip

__all__ = ["Cleaning", "Record", "predict_tip", "read_motors", "read_record"]
