"""Motors behind a microcontroller on a serial line: the host's side of docs/serial.md."""
