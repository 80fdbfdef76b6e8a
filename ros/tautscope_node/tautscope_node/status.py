"""What a node publishes of its state: operating state, warnings and diagnostics."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from crtk_msgs.msg import OperatingState as OperatingStateMessage
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.lifecycle import LifecycleNode
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import String
from tautscope.loop.safety import Reaction

from tautscope_node.control_loop import ControlLoop

REPORT_PERIOD = 0.1
"""Time between two calls of `StatusPublisher.update` [s]."""
REPORTS_PER_SECOND = 10
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


class StatusPublisher:
    """Publishes state and diagnostics every second and at changes, and warnings at changes.

    Args:
        node: Has the clock, the log and the name.
        publish: Creates a publisher of a type, topic and quality of service.
        hardware: Name of the instrument in the diagnostics.
    """

    def __init__(
        self,
        node: LifecycleNode,
        publish: Callable[[Any, str, QoSProfile], Any],
        hardware: str,
    ) -> None:
        self._node, self._hardware = node, hardware
        self._operating_state = publish(OperatingStateMessage, "operating_state", LATCHED)
        self._warning = publish(String, "warning", LATCHED)
        self._diagnostics = publish(DiagnosticArray, "/diagnostics", QoSProfile(depth=1))
        self._warned: tuple[Any, ...] = ()
        self._reports = 0

    def publish_state(self, control: ControlLoop) -> None:
        """Publish the operating state now."""
        message = OperatingStateMessage(state=str(control.state), is_homed=True)
        message.header.stamp = self._node.get_clock().now().to_msg()
        self._operating_state.publish(message)
        self._reported_state = control.state

    def update(self, control: ControlLoop, problem: str, counts: Mapping[str, int]) -> None:
        """Publish what has changed, and every second the rest.

        Args:
            control: The loop.
            problem: What is wrong with the calibration of the camera; empty if nothing is.
            counts: Of images, for the diagnostics.
        """
        supervision = control.supervision
        flags = tuple(dict.fromkeys((*supervision.flags, *supervision.latched)))
        is_refused = control.is_misplaced or control.is_unmeasured
        warned = (supervision.flags, supervision.latched, is_refused)
        has_warning = bool(flags) or is_refused
        text = f"{supervision.reaction}: {', '.join(flags)}"
        if control.is_misplaced:
            text = "the drives are not where the last command was: clean up and configure again"
        elif control.is_unmeasured:
            text = "enable is refused: it is not known where the drives are"
        if has_warning and warned != self._warned:
            self._warning.publish(String(data=text))
            self._node.get_logger().warning(text)
        self._warned = warned
        if control.state != self._reported_state or self._reports % REPORTS_PER_SECOND == 0:
            self.publish_state(control)
            text = text if has_warning else problem or str(control.state)
            self._diagnose(control, problem, counts, text)
        self._reports += 1

    def _diagnose(
        self, control: ControlLoop, problem: str, counts: Mapping[str, int], text: str
    ) -> None:
        supervision = control.supervision
        level = DiagnosticStatus.OK
        is_refused = control.is_misplaced or control.is_unmeasured
        if supervision.reaction.rank >= Reaction.HOLD_MOTION.rank or is_refused:
            level = DiagnosticStatus.ERROR
        elif supervision.flags or supervision.latched or problem:
            level = DiagnosticStatus.WARN
        values = {
            "operating_state": control.state,
            "reaction": supervision.reaction,
            "flags": ", ".join(supervision.flags),
            "latched": ", ".join(supervision.latched),
            **counts,
        }
        status = DiagnosticStatus(
            level=level,
            name=f"{self._node.get_fully_qualified_name()}: hysteresis reduction",
            hardware_id=self._hardware,
            message=text,
            values=[KeyValue(key=key, value=str(value)) for key, value in values.items()],
        )
        message = DiagnosticArray(status=[status])
        message.header.stamp = self._node.get_clock().now().to_msg()
        self._diagnostics.publish(message)
