"""``tautscope doctor``: what of a rig is there, what is missing, and what to type.

Nothing moves: no drive is ever enabled. Drives are set and read back as before a run.
"""
