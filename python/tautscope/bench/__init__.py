"""The bench: simulated drives on a CAN bus between processes, the same wire as hardware."""
