"""Calibration of any robot: kinematics, zeros and gains, and delays, from a sweep of its motors.

`Sweep` is the motion, `fit` estimates the parameters from what was recorded.
"""

from tautscope.calibration.robot.fit import RobotFit, fit
from tautscope.calibration.robot.motion_record import MotionRecord, move
from tautscope.calibration.robot.sweep import Sweep

__all__ = ["MotionRecord", "RobotFit", "Sweep", "fit", "move"]
