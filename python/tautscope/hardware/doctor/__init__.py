"""``tautscope doctor``: checks of a rig, and the remedy for everything that is missing.

No motor moves: the drives are configured as before a run, but never enabled.
"""
