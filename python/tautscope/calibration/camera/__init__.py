"""Calibration of the camera's intrinsics with a ChArUco board."""
