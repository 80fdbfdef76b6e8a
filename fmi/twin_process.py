"""The simulated instrument for an FMI unit: commands in, samples out, on standard input's socket.

``python twin_process.py CONFIG SEED HAS_CAMERA``; `twin.c` starts it. A request is four doubles: a
number of control periods and the command (3,) [m, rad, rad]. A reply is 0.0 and the outputs, or the
length of a message and the message.
"""

from __future__ import annotations

import socket
import struct
import sys

import numpy as np
from tautscope import MarkerDetector, Twin, load_config
from tautscope.errors import TautscopeError
from tautscope.loop.rig import Sample

REQUEST = struct.Struct("=4d")
NOTHING = np.full(4, np.nan)


class SimulatedInstrument:
    """The twin and a marker detector that has no prediction of where the markers are."""

    def __init__(self, path: str, seed: int, has_camera: bool) -> None:
        config = load_config(path).replace(**{"twin.seed": seed})
        self._twin = Twin(config, images=has_camera)
        self._detector = MarkerDetector(config)
        self._captured_at, self._features = np.nan, NOTHING

    def start(self) -> bytes:
        """Reply with the outputs at time 0."""
        return self._reply([self._twin.reset()])

    def step(self, periods: int, command: tuple[float, ...]) -> bytes:
        """Let control periods pass; reply with the outputs after them."""
        return self._reply([self._twin.step(command) for _ in range(periods)])

    def _reply(self, samples: list[Sample]) -> bytes:
        last = samples[-1]
        frames = [sample.frame for sample in samples if sample.frame is not None]
        if frames:
            self._captured_at = frames[-1].captured_at
            self._features = self._detector.detect(frames[-1].image).features
        assert last.true_state is not None
        image = (float(bool(frames)), self._captured_at, *self._features)
        return struct.pack("=13d", 0.0, *last.applied, *last.true_state, *image)


def main() -> None:
    path, seed, has_camera = sys.argv[1:]
    with socket.socket(fileno=0) as channel:
        try:
            instrument = SimulatedInstrument(path, int(seed), has_camera == "1")
            channel.sendall(instrument.start())
            while len(request := channel.recv(REQUEST.size, socket.MSG_WAITALL)) == REQUEST.size:
                periods, *command = REQUEST.unpack(request)
                channel.sendall(instrument.step(int(periods), tuple(command)))
        except TautscopeError as error:
            message = str(error).encode()
            channel.sendall(struct.pack("=d", len(message)) + message)


if __name__ == "__main__":
    main()
