"""The digital twin: a simulated rig that shares no code with the loop it tests."""

from tautscope.twin.rig import Twin
