"""Limits of what may connect: address, sizes, times, rates, and number of connections."""

from __future__ import annotations

ADDRESS = "127.0.0.1"
LARGEST_MESSAGE = 2048
"""Longest message that is read [byte]."""
LARGEST_CONNECTIONS = 24
"""Connections at most, with those that have not sent their token."""
TOKEN_TIME = 2.0
"""Time within which a connection has to send the token [s]."""
RATE, BURST = 150.0, 450.0
"""Messages per second of one connection on average, and at once."""


class RateLimit:
    """A token bucket: `BURST` messages at once, refilled by `RATE` per second."""

    def __init__(self, now: float) -> None:
        self._left, self._at = BURST, now

    def allows(self, now: float) -> bool:
        """Whether a message is allowed at a time [s]; counts it."""
        self._left = min(BURST, self._left + (now - self._at) * RATE)
        self._at = now
        if self._left < 1:
            return False
        self._left -= 1
        return True
