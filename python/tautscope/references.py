"""Users import references from here; the code is in `tautscope.loop.references`."""

from tautscope.loop.references import (
    DatedReference,
    OperatorMotion,
    RecordedReference,
    Reference,
    Segment,
    SineSequence,
)

__all__ = [
    "DatedReference",
    "OperatorMotion",
    "RecordedReference",
    "Reference",
    "Segment",
    "SineSequence",
]
