"""Calibration: configuration values from recorded data."""
