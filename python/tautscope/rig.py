"""Users import the rig's interface from here; the code is in `tautscope.loop.rig`."""

from tautscope.loop.rig import Frame, Rig, Sample

__all__ = ["Frame", "Rig", "Sample"]
