"""Who may connect: token, host, origin, rates, and number of connections."""

from __future__ import annotations

import hmac
import secrets

ADDRESS = "127.0.0.1"
LARGEST_MESSAGE = 2048
"""Longest message that is read [byte]."""
LARGEST_CONNECTIONS = 24
"""Connections at most, with those that have not sent their token."""
TOKEN_TIME = 2.0
"""Time within which a connection has to send the token [s]."""
RATE, BURST = 150.0, 450.0
"""Messages per second of one connection on average, and at once."""


def new_token() -> str:
    """A token of 256 random bits."""
    return secrets.token_urlsafe(32)


class Access:
    """The token, and the hosts and origins of one server.

    Args:
        token: The token.
        port: The server's port.
    """

    def __init__(self, token: str, port: int) -> None:
        self._token = token.encode()
        self.hosts = [f"{name}:{port}" for name in (ADDRESS, "localhost")]
        self.origins = [f"http://{host}" for host in self.hosts]

    def is_token(self, text: str) -> bool:
        """Whether this is the token; takes as long for any text of its length."""
        return hmac.compare_digest(text.encode(), self._token)

    def is_host(self, values: list[str]) -> bool:
        """Whether these values of the header ``Host`` are one of this server's names."""
        return len(values) == 1 and values[0] in self.hosts


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
