"""What the node publishes about rig, loop and itself."""

from collections import Counter
from concurrent.futures import Future

from tautscope.config import Config
from tautscope.console.control_run import ControlRun
from tautscope.errors import MessageError
from tautscope.hardware.realtime import OTHERS, realtime_executor
from tautscope.log import fields
from tautscope.log.fields import header_of
from tautscope.loop.measurement import Measurement
from tautscope.loop.reduction import Report
from tautscope.loop.rig import Frame
from tautscope.ros2 import messages
from tautscope.ros2.endpoints import IMAGE, Publisher
from tautscope.ros2.session import SENSOR_DATA, Clock, Node

OK, WARN, ERROR = 0, 1, 2
"""Levels of diagnostic_msgs/msg/DiagnosticStatus."""
STATE_PERIOD = 100_000_000
"""Time between two operating states [ns]; a change is published at once."""
DIAGNOSTICS_PERIOD = 1_000_000_000
"""Time between two diagnostics, and between two warnings of the same field [ns]."""


class Telemetry:
    """Publishes ticks, updates, state, warnings, diagnostics; with a rig, its drives and images."""

    def __init__(self, config: Config, node: Node, clock: Clock, *, has_rig: bool) -> None:
        self._config, self._clock, self._has_rig = config, clock, has_rig
        self._node = node
        self._name = node.identity.path.lstrip("/")
        self._joints = [dof.label for dof in config.dofs]
        joints, text = "sensor_msgs/msg/JointState", "std_msgs/msg/String"

        def publisher(name: str, kind: str) -> Publisher:
            return node.publisher(f"instrument/{name}", kind)

        self._setpoint = publisher("setpoint_js", joints)
        self._tip = publisher("measured_js", joints)
        self._offsets = publisher("hysteresis/delta", "std_msgs/msg/Float64MultiArray")
        self._mode = publisher("hysteresis/mode", text)
        self._compensation = publisher("hysteresis/compensation", "std_msgs/msg/Float64")
        self._result = publisher("hysteresis/result", text)
        self._state = publisher("operating_state", "crtk_msgs/msg/OperatingState")
        self._warning = publisher("warning", text)
        self._diagnostics = node.publisher("/diagnostics", "diagnostic_msgs/msg/DiagnosticArray")
        if not config.dof:
            self._camera_info = node.publisher(
                "endoscope/camera_info", "sensor_msgs/msg/CameraInfo"
            )
        if has_rig:
            self._command = publisher("actuators/setpoint_js", joints)
            self._applied = publisher("actuators/measured_js", joints)
        if has_rig and not config.dof:
            self._image = node.publisher("endoscope/image_raw", IMAGE, SENSOR_DATA)
        # The transport may wait for a slow receiver; a tick may not.
        self._images = realtime_executor("images", OTHERS)
        self._sending: Future[None] = Future()
        self._sending.set_result(None)
        self.refused: Counter[str] = Counter()
        self._warned: dict[str, int] = {}
        self._flags: tuple[str, ...] = ()
        self._shown: tuple[str, bool, bool] | None = None
        self._shown_at = self._diagnosed_at = -STATE_PERIOD

    def tick(self, run: ControlRun) -> None:
        """Publish set-points, and the positions of the drives."""
        now, joints = self._clock.wall(), self._joints
        self._setpoint.publish(messages.joint_state(now, joints, run.reference))
        if self._has_rig:
            self._command.publish(messages.joint_state(now, joints, run.command))
            self._applied.publish(messages.joint_state(now, joints, run.sample.applied))
        flags = run.loop.supervision.flags
        for flag in sorted(set(flags) - set(self._flags)):
            self.warn(f"{flag}: {run.loop.supervision.reaction}")
        self._flags = flags

    def update(self, run: ControlRun, source: Frame | Measurement, report: Report) -> None:
        """Publish an update; of an image also the camera, and the image if anybody receives it."""
        age = fields.nanoseconds_of(run.sample.time - report.captured_at)
        captured = self._clock.wall() - age
        self._tip.publish(messages.tip_state(captured, self._joints, report))
        self._offsets.publish(fields.offsets(self._joints, report))
        supervision = run.loop.supervision
        self._mode.publish({"data": str(supervision.reaction)})
        self._compensation.publish({"data": run.compensation * supervision.lead})
        if not isinstance(source, Frame):
            return
        self._camera_info.publish(fields.camera_info(captured, self._config.camera))
        if self._has_rig and self._sending.done() and self._image.has_subscribers:
            if (error := self._sending.exception()) is not None:
                self._warn_now_and_then("image", f"an image was not sent: {error}")
            self._sending = self._images.submit(self._send_image, captured, source)

    def _send_image(self, captured: int, frame: Frame) -> None:
        image = messages.image(captured, frame, self._config.camera)
        if image is not None:
            self._image.publish(image)

    def close(self) -> None:
        """Wait for the image that is sent."""
        self._images.shutdown()

    def state(self, state: str, *, is_homed: bool = False, is_busy: bool = False) -> None:
        """Publish the operating state, if it has changed or is due."""
        now, shown = self._clock.monotonic(), (state, is_homed, is_busy)
        if shown == self._shown and now - self._shown_at < STATE_PERIOD:
            return
        self._shown, self._shown_at = shown, now
        header = header_of(self._clock.wall(), "")
        found = {"header": header, "state": state, "is_homed": is_homed, "is_busy": is_busy}
        self._state.publish(found)

    def refuse(self, error: MessageError) -> None:
        """Count a refused message, and warn at most once per second and field."""
        self.refused[error.field] += 1
        self._warn_now_and_then(error.field, f"refused: {error}")

    def _warn_now_and_then(self, what: str, text: str) -> None:
        now = self._clock.monotonic()
        if now - self._warned.get(what, -DIAGNOSTICS_PERIOD) >= DIAGNOSTICS_PERIOD:
            self._warned[what] = now
            self.warn(text)

    def result(self, text: str) -> None:
        """Publish what the compensation achieved."""
        self._result.publish({"data": text})

    def warn(self, text: str) -> None:
        """Publish a warning."""
        self._warning.publish({"data": text})

    def diagnose(self, run: ControlRun | None, state: str, fault: str) -> None:
        """Publish diagnostics, once per second."""
        now = self._clock.monotonic()
        if now - self._diagnosed_at < DIAGNOSTICS_PERIOD:
            return
        self._diagnosed_at = now
        values: dict[str, object] = {}
        for each in self._node.subscriptions:
            values[f"received {each.topic}"] = each.received
            values[f"missed {each.topic}"] = each.missed
        values |= {f"refused {name}": n for name, n in self.refused.items()}
        flags: tuple[str, ...] = ()
        if run is not None:
            flags = run.loop.supervision.flags
            values |= {
                "ticks": run.ticks,
                "late ticks": run.late,
                "unused images": run.unused,
                "log": run.path,
                "dropped by the log": run.log.dropped,
            }
        level = ERROR if fault else WARN if flags else OK
        message = fault or ", ".join(flags) or state
        status = {
            "level": level,
            "name": self._name,
            "message": message,
            "hardware_id": "tautscope",
        }
        header = header_of(self._clock.wall(), "")
        self._diagnostics.publish(fields.diagnostics(header, values, **status))
