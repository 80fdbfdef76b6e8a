"""Servos on a serial line: Dynamixel X (protocol 2.0) and Feetech STS."""
