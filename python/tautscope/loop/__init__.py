"""The loop of Fig. 6 with what it meets: rig, references, vision, safety."""
