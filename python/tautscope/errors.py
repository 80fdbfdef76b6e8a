"""What can go wrong: one base class, one subclass per cause, each carrying the facts."""

from __future__ import annotations


class TautscopeError(Exception):
    """Base of every error this package raises on purpose."""


class FieldError(TautscopeError, ValueError):
    """A named input holds what it may not.

    Args:
        field: Where, as a path the user can find (``insertion.free_gain``, ``reference``).
        value: What came.
        allowed: What may come, in words.
    """

    def __init__(self, field: str, value: object, allowed: str) -> None:
        self.field = field
        self.value = value
        self.allowed = allowed
        super().__init__(f"{field}: got {value!r}, expected {allowed}")

    def __reduce__(self) -> tuple[type[FieldError], tuple[str, object, str]]:
        """Pickle by the facts, so that the error survives the way back from a worker process."""
        return type(self), (self.field, self.value, self.allowed)


class ConfigError(FieldError):
    """A configuration value is unknown, of the wrong type or out of range."""


class FrameError(FieldError):
    """An image is not what a camera of this configuration gives."""


class SignalError(FieldError):
    """A reference or command is not three finite numbers."""


class RecordError(FieldError):
    """A recorded file lacks a column or holds what is not a number."""


class MissingPathError(FieldError):
    """A file or folder that was asked for is not there, or holds nothing usable."""


class OutputError(FieldError):
    """A result cannot be written where it was asked for."""


class CameraError(FieldError):
    """A camera is not there, or does not give the pictures it should."""
