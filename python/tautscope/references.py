"""Users import references from here; the code is in `tautscope.loop.references`."""

from tautscope.loop.references import DatedReference, Reference, Segment, SineSequence

__all__ = ["DatedReference", "Reference", "Segment", "SineSequence"]
