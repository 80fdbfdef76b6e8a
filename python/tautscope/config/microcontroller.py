"""Motors behind a microcontroller, and which protocols have a serial port."""

from tautscope.config.servos import PORTS

PROTOCOL = "serial"
"""``drives.protocol`` of the serial line protocol, docs/serial.md."""
SERIAL_PORTS = PORTS | {PROTOCOL: "/dev/ttyACM0"}
"""Protocols on a serial port, none of them CiA 402, and the port on Linux."""
MOST_AXES = 8
"""Largest number of axes of a microcontroller."""
