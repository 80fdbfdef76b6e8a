"""Models of hysteresis compared on records of an actuator and its tip."""
