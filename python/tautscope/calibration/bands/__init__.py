"""Calibration of the bands' colour without masks: bands that move with the motors, or clicks."""
