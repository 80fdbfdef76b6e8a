"""A simulated steerable tip of a colonoscope: two bending planes, insertion and an EM tracker.

It shares no code with the loop that it tests; see `tautscope.twin.colonoscope.model` for its
physics.
"""

from tautscope.twin.colonoscope.parameters import ColonoscopeParameters
from tautscope.twin.colonoscope.rig import ColonoscopeTwin
