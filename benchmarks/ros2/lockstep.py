"""The node and the Python loop with the same input, tick by tick, on a clock that the test steps.

References, images and positions go to the node as messages over Zenoh, in a session of their own;
commands come back the same way. The Python loop gets the arrays and times themselves.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from ros2.peers import BARRIER, EPOCH, peers
from tautscope.config import Config
from tautscope.loop.reduction import HysteresisReduction
from tautscope.loop.references import OperatorMotion
from tautscope.loop.rig import Frame
from tautscope.ros2 import messages
from tautscope.twin.rig import Twin

Floats = NDArray[np.float64]
Shares = Sequence[tuple[float, float]]


@dataclass
class Result:
    """Comparison of the node's commands with those of the Python loop.

    Attributes:
        ticks: Number of compared commands.
        different: Number of commands with other bits.
        images: Number of images sent.
        updates: Number of image updates of the node.
        travel: (3,) travel of the command [m, rad, rad].
        missed: Number of messages that the node did not get.
        log: The node's log.
    """

    ticks: int = 0
    different: int = 0
    images: int = 0
    updates: int = 0
    travel: Floats = field(default_factory=lambda: np.zeros(3))
    missed: int = 0
    log: Path = Path()


def compare(
    config: Config, folder: Path, duration: float, seed: int, shares: Shares = ()
) -> Result:
    """Run the twin with the Python loop, and the node beside it with the same input.

    Args:
        config: Of both loops.
        folder: For the node's log.
        duration: [s].
        seed: Of the operator's motion.
        shares: (time [s], share of the compensation) of changes.
    """
    period = round(config.control.period * 1e9)
    motion = OperatorMotion(config.experiment, seed, duration)
    loop, twin, result, changes = HysteresisReduction(config), Twin(config), Result(), list(shares)
    sample = twin.reset()
    pending = None
    with peers(config, folder) as both:
        clock = both.clock
        both.enable(sample.applied)
        start, command, reference = clock.now, sample.applied, np.array(sample.applied)
        offset, frame, made_at = motion(0.0) - reference, None, None

        def send() -> None:
            both.send_position(sample.applied)
            both.send_reference(reference)
            if frame is not None:
                stamp = EPOCH + start + frame_time
                both.images.publish(messages.image(stamp, frame, config.camera))
            both.delivered()

        clock.before_tick = send
        for tick in range(round(duration / config.control.period)):
            now = tick * period / 1e9
            if changes and now >= changes[0][0]:
                share = changes.pop(0)[1]
                loop.set_compensation(share)
                both.control.run.loop.set_compensation(share)
            before = command
            command = loop.step(reference, now, made_at)
            if pending is not None:
                loop.on_detection(*pending)
                pending = None
            if frame is not None:
                pending = frame, loop.prepare_detection(frame)()
            sample = twin.step(command)
            if tick > 0:  # the stream begins at the set-point, bit for bit
                reference = motion(tick * config.control.period) - offset
            made_at = (tick + 1) * period / 1e9
            frame = sample.frame
            if frame is not None:
                frame_time = round(frame.captured_at * 1e9)
                frame = Frame(frame.image, frame_time / 1e9, frame.sequence)
                result.images += 1
            both.tick()
            sent = both.received(both.commands, "command").position
            result.ticks += 1
            result.different += sent.tobytes() != command.tobytes()
            result.travel += np.abs(command - before)
        run = both.control.run
        result.updates, result.log = run.loop.updates, run.path
        # A barrier that is sent again under load replaces another, which is no loss.
        result.missed = sum(
            each.missed for each in both.node.subscriptions if not each.topic.startswith(BARRIER)
        )
        clock.before_tick = lambda: None
    twin.close()
    return result
