"""Lifecycle node with rclpy: CRTK topics in and out, and the loop in between."""

from __future__ import annotations

import signal
import threading
from collections import deque
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any

import rclpy
from crtk_msgs.msg import OperatingState as OperatingStateMessage
from crtk_msgs.msg import StringStamped
from geometry_msgs.msg import PointStamped, PoseStamped, PoseWithCovarianceStamped
from rcl_interfaces.msg import SetParametersResult
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.executors import MultiThreadedExecutor
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.parameter import Parameter
from rclpy.qos import HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
from rclpy.time import Time
from sensor_msgs.msg import CameraInfo, Image, JointState
from std_msgs.msg import Float64MultiArray, MultiArrayDimension
from tautscope import Frame, Sample, load_config
from tautscope.errors import ConfigError, MessageError
from tautscope.loop.measurement import Measurement
from tautscope.loop.operating_state import STATE_COMMANDS, OperatingState
from tautscope.loop.safety import Reaction
from tautscope.report.achieved import Achieved, achieved_text
from tautscope.ros2.inputs import ImageReader, checked_stamp
from tautscope.ros2.measurements import MeasurementReader

from tautscope_node.control_loop import ControlLoop
from tautscope_node.messages import (
    DEFAULT_JOINTS,
    calibration_problem,
    is_measured,
    joints_of,
    nanoseconds,
    offsets,
    positions,
)
from tautscope_node.status import REPORT_PERIOD, StatusPublisher

MEASURED_TIMEOUT = 0.2
"""Without a used measurement for this long, `measured_js` is invalid [s]."""
MOST_MEASUREMENTS = 64
"""The newest ones that wait for a tick are used; without ticks no more are kept."""
LATEST = QoSProfile(depth=1)
COMMANDS = QoSProfile(depth=10)
IMAGES, MEASUREMENTS = (
    QoSProfile(
        depth=depth, history=HistoryPolicy.KEEP_LAST, reliability=ReliabilityPolicy.BEST_EFFORT
    )
    for depth in (1, 10)
)
SENSORS = {
    kind.__name__: kind
    for kind in (JointState, PointStamped, PoseStamped, PoseWithCovarianceStamped)
}
"""`measurement.topics[].type` -> type of the messages."""


class InstrumentNode(LifecycleNode):
    """Node of the instrument.

    Everything but the reception of images runs in its default callback group, one at a time.
    Detection runs in a thread of its own, so that no tick waits for it.
    """

    def __init__(self, **options: Any) -> None:
        super().__init__("tautscope", **options)
        self.declare_parameter("config", "")
        self.declare_parameter("joints", DEFAULT_JOINTS)
        self.declare_parameter("image_topic", "/endoscope/image_raw")
        self.declare_parameter("camera_info_topic", "/endoscope/camera_info")
        self.declare_parameter("frame_id", "guide")
        self.declare_parameter("compensation", 1.0)
        self._control: ControlLoop | None = None
        self._detection: ThreadPoolExecutor | None = None
        self._session_subscriptions: list[Any] = []
        self._session_publishers: list[Any] = []
        self._session_timers: list[Any] = []
        self._last_state = OperatingState.DISABLED
        self.add_on_set_parameters_callback(self._on_parameters)

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Read the configuration, and create the loop, publishers and subscriptions."""
        try:
            path = Path(self.get_parameter("config").value)
            self._config = load_config(path)
            self._joints = joints_of(self.get_parameter("joints").value, self._config)
            self._image_topic = self.get_parameter("image_topic").value
            self._reader = ImageReader(self._image_topic, self._config.camera)
            self._detection = ThreadPoolExecutor(1, "detection")
            self._control = ControlLoop(self._config, self._detection)
            self._control.loop.set_compensation(self.get_parameter("compensation").value)
        except (ConfigError, OSError, ValueError) as error:
            self.get_logger().error(str(error))
            self._release()
            return TransitionCallbackReturn.FAILURE
        self._origin = self.get_clock().now().nanoseconds
        self._frame_id = self.get_parameter("frame_id").value
        self._newest: Frame | None = None
        self._measurements: deque[Measurement] = deque(maxlen=MOST_MEASUREMENTS)
        self._sequence = 0
        self._arrived = self._replaced = self._used = 0
        self._measured_at = -1.0
        self._problem = ""
        self._create_topics()
        return TransitionCallbackReturn.SUCCESS

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Start the ticks; the state command `enable` starts the motion."""
        assert self._control is not None
        # What was requested or measured before is not used now.
        self._control.request("disable", self._now())
        self._control.exchange(None)
        self._newest = None
        self._measurements.clear()
        self._last_state = OperatingState.DISABLED
        self._achieved = Achieved(self._config)
        self._session_timers = [
            self.create_timer(self._control.period, self._tick),
            self.create_timer(REPORT_PERIOD, self._report),
        ]
        return TransitionCallbackReturn.SUCCESS

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Stop the drives."""
        self.stop()
        return TransitionCallbackReturn.SUCCESS

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Stop the drives and release everything."""
        self.stop()
        self._release()
        return TransitionCallbackReturn.SUCCESS

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Stop the drives and release everything."""
        return self.on_cleanup(state)

    def on_error(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Stop the drives and release everything."""
        return self.on_cleanup(state)

    def stop(self) -> None:
        """Stop the drives and end the ticks."""
        for timer in self._session_timers:
            self.destroy_timer(timer)
        self._session_timers = []
        if self._control is not None and self._last_state is not OperatingState.DISABLED:
            self._stop_drives()
            self._control.request("disable", self._now())
            self._last_state = OperatingState.DISABLED
            self._status_publisher.publish_state(self._control)
            if results := self._achieved.results():
                self.get_logger().info(achieved_text(results))

    def _create_topics(self) -> None:
        publish, subscribe = self._publisher, self._subscribe
        self._setpoint = publish(JointState, "setpoint_js", LATEST)
        self._actuators = publish(JointState, "actuators/setpoint_js", LATEST)
        self._actuators_command = publish(StringStamped, "actuators/state_command", COMMANDS)
        self._measured = publish(JointState, "measured_js", LATEST)
        self._delta = publish(Float64MultiArray, "hysteresis/delta", LATEST)
        self._status_publisher = StatusPublisher(self, publish, self._frame_id)
        subscribe(JointState, "servo_jp", self._on_reference, LATEST)
        subscribe(StringStamped, "state_command", self._on_state_command, COMMANDS)
        subscribe(JointState, "actuators/measured_js", self._on_measured, LATEST)
        subscribe(OperatingStateMessage, "actuators/operating_state", self._on_actuators, LATEST)
        if self._config.dof:
            self._subscribe_sensors()
        else:
            camera_info = self.get_parameter("camera_info_topic").value
            subscribe(CameraInfo, camera_info, self._on_camera_info, LATEST)
            group = MutuallyExclusiveCallbackGroup()
            subscribe(Image, self._image_topic, self._on_image, IMAGES, callback_group=group)
        assert self._control is not None
        self._status_publisher.publish_state(self._control)

    def _subscribe_sensors(self) -> None:
        for sensor, topic in enumerate(self._config.measurement.topics):
            reader = MeasurementReader(self._config, sensor, topic.name)
            callback = partial(self._on_measurement, reader, topic.name)
            self._subscribe(SENSORS[topic.type], topic.name, callback, MEASUREMENTS)

    def _publisher(self, kind: Any, topic: str, qos: QoSProfile) -> Any:
        # Not those of the lifecycle: the state is published also while the node is not active.
        publisher = self.create_publisher(kind, topic, qos)
        self._session_publishers.append(publisher)
        return publisher

    def _subscribe(
        self, kind: Any, topic: str, callback: Any, qos: QoSProfile, **options: Any
    ) -> None:
        subscription = self.create_subscription(kind, topic, callback, qos, **options)
        self._session_subscriptions.append(subscription)

    def _release(self) -> None:
        for subscription in self._session_subscriptions:
            self.destroy_subscription(subscription)
        for publisher in self._session_publishers:
            self.destroy_publisher(publisher)
        self._session_subscriptions, self._session_publishers = [], []
        if self._detection is not None:
            self._detection.shutdown()
        self._control = self._detection = None

    def _now(self) -> float:
        """Seconds since the node was configured, on its clock."""
        return 1e-9 * (self.get_clock().now().nanoseconds - self._origin)

    def _on_reference(self, message: JointState) -> None:
        reference = positions(message, self._joints)
        if self._control is None:
            return
        if reference is None:
            self.get_logger().warning("servo_jp: joints are missing", throttle_duration_sec=1.0)
            return
        now, stamp = self.get_clock().now().nanoseconds, nanoseconds(message.header.stamp)
        made_at = min(stamp, now) if stamp else now
        self._control.set_reference(reference, 1e-9 * (made_at - self._origin))

    def _on_state_command(self, message: StringStamped) -> None:
        if self._control is not None and not self._control.request(message.string, self._now()):
            self.get_logger().warning(
                f"state_command {message.string}: expected {', '.join(STATE_COMMANDS)} or "
                "acknowledge"
            )

    def _on_measured(self, message: JointState) -> None:
        measured = positions(message, self._joints)
        # CRTK: a stamp of 0 marks what is not valid. Others count by their arrival.
        if self._control is None or not nanoseconds(message.header.stamp):
            return
        if measured is None:
            topic = "actuators/measured_js"
            self.get_logger().warning(f"{topic}: joints are missing", throttle_duration_sec=1.0)
            return
        self._control.set_measured(measured, self._now())

    def _on_actuators(self, message: OperatingStateMessage) -> None:
        if self._control is not None and message.state == OperatingState.FAULT:
            self._control.raise_drive_fault()

    def _on_camera_info(self, message: CameraInfo) -> None:
        self._problem = calibration_problem(message, self._config.camera)
        if self._problem:
            self.get_logger().error(self._problem, throttle_duration_sec=10.0)

    def _on_measurement(self, reader: MeasurementReader, topic: str, message: Any) -> None:
        self._arrived += 1
        try:
            stamp = checked_stamp(topic, message.header, self.get_clock().now().nanoseconds)
            found = reader.read(message, 1e-9 * (stamp - self._origin))
        except MessageError as error:
            self.get_logger().error(str(error), throttle_duration_sec=1.0)
            return
        if found is not None:
            self._measurements.append(found)

    def _on_image(self, message: Image) -> None:
        captured_at = 1e-9 * (nanoseconds(message.header.stamp) - self._origin)
        try:
            frame = self._reader.read(message, captured_at, self._sequence + 1)
        except MessageError as error:
            self.get_logger().error(str(error), throttle_duration_sec=1.0)
            return
        self._sequence += 1
        self._arrived += 1
        self._replaced += self._newest is not None
        self._newest = frame

    def _tick(self) -> None:
        control = self._control
        if control is None:
            return
        now = self._now()
        tick = control.step(now)
        if tick.is_sent:
            share = control.supervision.lead * self.get_parameter("compensation").value
            sample = Sample(now, tick.command)
            self._achieved.add_tick(sample, control.reference, tick.command, share)
            stamp = self.get_clock().now().to_msg()
            self._actuators.publish(self._joint_state(tick.command, stamp))
            self._setpoint.publish(self._joint_state(control.reference, stamp))
        if tick.state is OperatingState.FAULT and self._last_state is not OperatingState.FAULT:
            self._stop_drives()
        self._last_state = tick.state
        # After the command, which never waits for an image.
        frame, self._newest = self._newest, None
        measurements = list(self._measurements)
        self._measurements.clear()
        for seen, report in control.exchange(frame, measurements):
            self._achieved.add_update(now, seen, report)
            self._used += 1
            stamp = Time().to_msg()
            if is_measured(report):
                captured = self._origin + round(1e9 * report.captured_at)
                stamp = Time(nanoseconds=captured).to_msg()
                self._measured_at = self._now()
            self._measured.publish(self._joint_state(report.state_estimate, stamp))
            labels = [dof.label for dof in self._config.dofs]
            delta = Float64MultiArray()
            delta.layout.dim = [
                MultiArrayDimension(
                    label=",".join(labels), size=len(labels), stride=2 * len(labels)
                ),
                MultiArrayDimension(label="minus,plus", size=2, stride=2),
            ]
            delta.data = offsets(report)
            self._delta.publish(delta)

    def _joint_state(self, values: Any, stamp: Any) -> JointState:
        message = JointState(name=self._joints, position=[float(value) for value in values])
        message.header.stamp = stamp
        message.header.frame_id = self._frame_id
        return message

    def _stop_drives(self) -> None:
        """Quick stop; or disable, where the loop has to be created anew."""
        assert self._control is not None
        is_final = self._control.supervision.reaction is Reaction.DISABLE
        command = StringStamped(string="disable" if is_final else "pause")
        command.header.stamp = self.get_clock().now().to_msg()
        self._actuators_command.publish(command)

    def _report(self) -> None:
        control = self._control
        if control is None:
            return
        if control.state is OperatingState.FAULT:
            # A message may be lost, and a drive may begin to listen later.
            self._stop_drives()
        what = "measurements" if self._config.dof else "images"
        counts = {
            f"{what} arrived": self._arrived,
            f"{what} replaced by newer ones": self._replaced,
            f"{what} used": self._used,
        }
        self._status_publisher.update(control, self._problem, counts)
        if self._now() - self._measured_at > MEASURED_TIMEOUT:
            self._measured.publish(self._joint_state([0.0] * len(self._joints), Time().to_msg()))

    def _on_parameters(self, parameters: list[Parameter]) -> SetParametersResult:
        for parameter in parameters:
            if parameter.name == "compensation" and self._control is not None:
                try:
                    self._control.loop.set_compensation(parameter.value)
                except ConfigError as error:
                    return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)


def main(arguments: list[str] | None = None) -> None:
    """Run the node until it is interrupted or terminated; then the drives are stopped."""
    # The context outlives the signal, so that the stop can still be published.
    rclpy.init(args=arguments, signal_handler_options=SignalHandlerOptions.NO)
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    node = InstrumentNode()
    executor = MultiThreadedExecutor(2)
    executor.add_node(node)
    # In the main thread a wait for messages would also wait with the signal.
    spinning = threading.Thread(target=executor.spin, daemon=True)
    spinning.start()
    try:
        while spinning.is_alive():
            spinning.join(0.1)
    except KeyboardInterrupt:
        pass
    finally:
        executor.shutdown()
        node.stop()
        node.destroy_node()
        rclpy.try_shutdown()
