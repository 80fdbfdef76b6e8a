"""The control process of the console: it receives commands, runs the loop, publishes its state.

It shares nothing with the web server but memory, and waits for nothing that the server does.
"""

import logging
import time
from collections.abc import Callable

from tautscope.console import messages as msg
from tautscope.console.actions import Actions
from tautscope.console.control_run import ControlRun, Update
from tautscope.console.publisher import Bands, Publisher
from tautscope.console.rig_control import RigControl
from tautscope.console.session_state import session_state
from tautscope.console.shared import Channels
from tautscope.console.state import STATE_PERIOD
from tautscope.errors import TautscopeError, described
from tautscope.loop.frame_layout import FrameLayout
from tautscope.loop.rig import Frame
from tautscope.loop.safety import Reaction

_LOG = logging.getLogger(__name__)
_IDLE_PERIOD = 0.005
"""Time between two looks at the commands while the rig is off [s]."""


class Session:
    """Runs the control loop for the operator's console, until `must_end`."""

    def __init__(
        self, control: RigControl, channels: Channels, must_end: Callable[[], bool] = lambda: False
    ) -> None:
        self._control, self._channels, self._must_end = control, channels, must_end
        self._publisher = Publisher(control.config, channels.images)
        self._actions = Actions(control, lambda: self._publisher.image)
        self._layout = FrameLayout(control.config.camera)
        self._pictures = 0
        self._published_at = 0.0
        control.while_opening = self._idle_opening

    def main(self) -> None:
        """Run until it has to end; the motors are stopped and the log is closed on every exit.

        Raises:
            StateError: As `RigControl.shut_down`.
        """
        control = self._control
        try:
            if not control.is_hardware:
                control.open()
            while not self._must_end():
                self._receive()
                if control.run is None:
                    self._publish()
                    time.sleep(_IDLE_PERIOD)
                else:
                    self._tick(control.run)
        finally:
            try:
                control.shut_down()
            finally:
                self._publisher.close()

    def _tick(self, run: ControlRun) -> None:
        control = self._control
        self._publisher.log_path = run.path
        try:
            self._show(run, run.tick())
            supervision = run.loop.supervision
            if supervision.reaction.rank >= Reaction.QUICK_STOP.rank and control.is_hardware:
                reason = f"{supervision.reaction}: {', '.join(supervision.flags)}"
                control.close(reason, is_disabling=supervision.reaction is Reaction.DISABLE)
                return
            self._publish()
            run.step()
        except TautscopeError as error:
            _LOG.warning("%s", error)
            control.close(described(error))

    def _show(self, run: ControlRun, updates: list[Update]) -> None:
        """Show what images of the bands told, or a picture that tells the loop nothing."""
        for frame, report, arrived_at in updates:
            if not isinstance(frame, Frame):
                continue
            sequence = self._control.images.add(arrived_at)
            detection = report.detection
            found = (False, False) if detection is None else detection.found
            told = report.state_estimate, report.predicted_state, run.reference
            bands = Bands(*told, run.uncompensated_at(report.captured_at), found)
            self._publisher.submit(sequence, frame.image, arrived_at, bands)
        if self._control.config.dof and (picture := run.sample.frame) is not None:
            self._layout.checked(picture.image)
            self._pictures += 1
            self._publisher.submit(self._pictures, picture.image, time.monotonic())

    def _idle_opening(self) -> None:
        self._receive_motion()
        self._publish()

    def _receive(self) -> None:
        self._receive_motion()
        while (found := self._channels.inbound.following()) is not None:
            reply = self._actions.execute(msg.decode_inbound(found[1]))
            if reply is not None:
                self._channels.replies.write(msg.encode(reply))

    def _receive_motion(self) -> None:
        """Stops first, because they have priority."""
        if (found := self._channels.stop.newest()) is not None:
            self._control.stop(f"STOP by page {msg.decode_received(found[1]).client}")
        while (found := self._channels.servo.following()) is not None:
            self._control.operator.receive(msg.decode_received(found[1]), time.monotonic())

    def _publish(self) -> None:
        now = time.monotonic()
        if now - self._published_at < STATE_PERIOD * 0.9:
            return
        self._published_at = now
        if self._control.config.dof:
            self._control.images.add(now)
        state = session_state(self._control, self._publisher.log, now)
        if failure := self._publisher.failure:
            state.message = f"{state.message} {failure}"[: msg.LONGEST_REASON]
        self._channels.state.write(msg.encode(state))
