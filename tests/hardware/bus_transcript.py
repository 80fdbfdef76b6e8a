"""A bus that records frames, and a fieldbus on it."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager

import can
from drive_settings import AXES, drives_config
from tautscope.dof import Dof
from tautscope.hardware.canopen_fieldbus import CanopenFieldbus


def frame(identifier: int, data: bytes) -> str:
    return f"{identifier:03X}#{data.hex().upper()}"


class Transcript(can.BusABC):
    """A bus that records sent frames and answers from a table."""

    def __init__(self, answer: Callable[[str], list[str]] = lambda sent: []) -> None:
        super().__init__(channel="bus_transcript")
        self.sent: list[str] = []
        self.waiting: list[str] = []
        self._answer = answer

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        self.sent.append(frame(msg.arbitration_id, bytes(msg.data)))
        self.waiting += self._answer(self.sent[-1])

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        if not self.waiting:
            return None, False
        identifier, data = self.waiting.pop(0).split("#")
        message = can.Message(
            arbitration_id=int(identifier, 16), data=bytes.fromhex(data), is_extended_id=False
        )
        return message, False


QUICK = {"heartbeat_period": 0.001, "cycle": 0.001, "reply_timeout": 5e-4}


@contextmanager
def open_transcript(
    answers: dict[str, str], node: int = 1
) -> Iterator[tuple[CanopenFieldbus, Transcript]]:
    """Open a fieldbus whose insertion drive has this node id."""
    bus = Transcript(lambda sent: [answers[sent]] if sent in answers else [])
    others = [other for other in range(1, 5) if other != node]
    axes = {
        dof.label: AXES[dof.label] | {"node": number}
        for dof, number in zip(Dof, [node, *others], strict=False)
    }
    fieldbus = CanopenFieldbus(drives_config(**QUICK, **axes), bus)
    try:
        yield fieldbus, bus
    finally:
        fieldbus.stop_communication([])  # no SDO transfers when it is closed
        fieldbus.close()
