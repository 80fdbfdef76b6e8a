"""Who may command: one lease, and the check of every command against it."""

from collections import deque

from tautscope.console.messages import Command, Servo

COMMAND_AGE = 0.25
"""Largest time since the image that a command names was published [s]."""
_IMAGES = 256
"""Number of published images whose times are kept."""


class ImageTimes:
    """When images were published, or without images states."""

    def __init__(self) -> None:
        self._times: deque[float] = deque(maxlen=_IMAGES)
        self.newest = 0
        """Sequence of the newest image; the first is 1."""

    def add(self, now: float) -> int:
        """Add an image published at a time [s]; its sequence."""
        self._times.append(now)
        self.newest += 1
        return self.newest

    def age(self, sequence: int, now: float) -> float:
        """Time since an image was published [s]; infinite if it was not, or long ago."""
        if not 0 < sequence <= self.newest or self.newest - sequence >= len(self._times):
            return float("inf")
        return now - self._times[sequence - 1 - self.newest]

    def outdated(self, sequence: int, now: float) -> float:
        """Time since an image was followed by another [s]; 0 for the newest."""
        return 0.0 if sequence == self.newest else self.age(sequence + 1, now)


class Lease:
    """The lease of the operator; at most one connection holds it.

    Attributes:
        number: Number of the lease; every change of the holder makes a new one.
        holder: The connection that holds it; None if nobody does.
    """

    def __init__(self, images: ImageTimes) -> None:
        self._images = images
        self.number = 0
        self.holder: int | None = None
        self._sequences = {True: -1, False: -1}

    def take(self, client: int | None) -> None:
        """Give the lease to a connection, or to none."""
        self.number += 1
        self.holder = client
        self._sequences = {True: -1, False: -1}

    def release(self, client: int) -> bool:
        """End the lease if this connection holds it; whether it did."""
        if self.holder != client:
            return False
        self.take(None)
        return True

    def refusal(self, client: int, command: Command, now: float, *, needs_image: bool) -> str:
        """Why a command is refused, before a colon with its figures; empty if it is accepted.

        A refused command changes nothing. `needs_image` also refuses a command for which no image
        of the last `COMMAND_AGE` was displayed: one that moves the instrument.
        """
        if self.holder is None:
            return "nobody has the lease"
        if client != self.holder or command.lease != self.number:
            return "another has the lease"
        # Deflections and requests arrive through different channels, each in order.
        is_servo = isinstance(command, Servo)
        if command.sequence <= self._sequences[is_servo]:
            return "repeated or out of order"
        age_of = self._images.age if needs_image else self._images.outdated
        age = age_of(command.image, now)
        if age == float("inf"):
            return "the page shows no recent image"
        if age > COMMAND_AGE:
            late = "the page shows an old image, or its commands are late"
            what = "no new image came" if command.image == self._images.newest else late
            return f"{what}: for {age:.2f} s, at most {COMMAND_AGE:g} s"
        self._sequences[is_servo] = command.sequence
        return ""
