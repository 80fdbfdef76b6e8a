"""Ticks of a node under test, with a stream of references or without."""

import numpy as np
from ros2.peers import Peers

START = np.array([0.025, 0.0, 0.9])


def drive(both: Peers, ticks: int, speed: float = 0.0, *, at: np.ndarray = START) -> np.ndarray:
    """Stream references that move insertion at a speed [m/s]; returns the last one."""
    reference = at.copy()

    def send() -> None:
        nonlocal reference
        both.send_position(START)
        both.send_reference(reference)
        both.delivered()
        reference = reference + np.array([speed * 5e-3, 0, 0])

    both.clock.before_tick = send
    for _ in range(ticks):
        both.tick()
    return reference - np.array([speed * 5e-3, 0, 0])


def rest(both: Peers, ticks: int) -> None:
    """Ticks without a reference; the driver goes on."""

    def send() -> None:
        both.send_position(START)
        both.delivered()

    both.clock.before_tick = send
    for _ in range(ticks):
        both.tick()


def commands(both: Peers) -> np.ndarray:
    return np.array([message.position for message in both.drain(both.commands)])
