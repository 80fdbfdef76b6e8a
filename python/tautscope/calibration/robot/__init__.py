"""Calibration of any robot: kinematics, zeros and gains, and delays, from a motion."""

from tautscope.calibration.motion import MotionRecord, move, sweep_motion
from tautscope.calibration.robot.fit import RobotFit, fit

__all__ = ["MotionRecord", "RobotFit", "fit", "move", "sweep_motion"]
