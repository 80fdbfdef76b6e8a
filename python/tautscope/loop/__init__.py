"""The loop of Fig. 6, and its interfaces: rig, references, vision, safety."""
