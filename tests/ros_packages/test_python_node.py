"""The node with rclpy replaced by test doubles: topics, stamps, and what it does when it ends."""

import doubles
import numpy as np
import pytest
from tautscope.config import Config, dump_config

doubles.install()
from tautscope_node.node import InstrumentNode  # noqa: E402

START = [25e-3, 0.0, 0.9]
JOINTS = ["insertion", "rotation", "bending"]


def stamped(nanoseconds, **fields):
    message = doubles.Message(**fields)
    message.header.stamp = doubles.Time(nanoseconds=nanoseconds).to_msg()
    return message


class Laboratory:
    """An active node, and what happens around it."""

    def __init__(self):
        self.node = InstrumentNode()
        assert self.node.on_configure(None) == "success"
        assert self.node.on_activate(None) == "success"
        self.drives = START
        self.are_silent = False

    def measure(self, position):
        message = stamped(self.node.now, name=JOINTS, position=list(position))
        self.node.callbacks["actuators/measured_js"](message)

    def run(self, duration, speed=None):
        """Timers of the node, with a reference in every tick if it has a speed [m/s]."""
        (period, tick), (_, report) = self.node.timers
        for number in range(round(duration / period)):
            if speed is not None:
                START[0] += speed * period
                self.refer(START)
            if not self.are_silent:
                self.measure(self.drives)
            tick()
            if commands := self.node.published["actuators/setpoint_js"]:
                self.drives = commands[-1].position
            if number % 20 == 0:
                report()
            self.node.now += round(period * 1e9)

    def refer(self, position, age=0):
        message = stamped(self.node.now - age, name=JOINTS, position=list(position))
        self.node.callbacks["servo_jp"](message)

    def request(self, text):
        if not self.are_silent:
            self.measure(self.drives)
        self.node.callbacks["state_command"](doubles.Message(string=text))

    def texts(self, topic):
        return [message.string for message in self.node.published[topic]]

    def warnings(self):
        return [message.data for message in self.node.published["warning"]]

    def states(self):
        return [message.state for message in self.node.published["operating_state"]]


@pytest.fixture
def laboratory(tmp_path, monkeypatch):
    path = tmp_path / "rig.toml"
    path.write_text(dump_config(Config()))
    monkeypatch.setattr(doubles.Node, "overrides", {"config": str(path)})
    monkeypatch.setitem(globals(), "START", [25e-3, 0.0, 0.9])
    return Laboratory()


def test_names_and_quality_of_service_are_those_of_crtk_and_sensors(laboratory):
    assert set(laboratory.node.callbacks) == {
        "servo_jp",
        "state_command",
        "actuators/measured_js",
        "actuators/operating_state",
        "/endoscope/image_raw",
        "/endoscope/camera_info",
    }
    assert set(laboratory.node.published) >= {
        "setpoint_js",
        "actuators/setpoint_js",
        "actuators/state_command",
        "measured_js",
        "operating_state",
        "warning",
        "/diagnostics",
    }
    assert laboratory.node.qos["/endoscope/image_raw"].reliability == "best effort"
    assert laboratory.node.qos["operating_state"].durability == "latched"
    assert laboratory.node.groups["/endoscope/image_raw"] is not None
    assert laboratory.node.groups["servo_jp"] is None


def test_commands_have_names_and_stamps_and_stop_with_the_device(laboratory):
    laboratory.run(0.1, speed=0.01)
    commands = laboratory.node.published["actuators/setpoint_js"]
    assert commands == []
    laboratory.request("enable")
    laboratory.run(0.5, speed=0.01)
    last = laboratory.node.now
    laboratory.run(1.0)
    assert all(each.name == JOINTS and each.header.frame_id == "guide" for each in commands)
    times = [each.header.stamp.sec * 10**9 + each.header.stamp.nanosec for each in commands]
    assert (np.diff(times) == 5_000_000).all()
    moved = np.diff([each.position[0] for each in commands]) != 0
    assert last - 10_000_000 < max(np.array(times)[1:][moved]) <= last + 100_000_000
    assert times[-1] > last + 900_000_000
    assert laboratory.states()[-1] == "PAUSED"
    assert any("reference_late" in text for text in laboratory.warnings())


def test_enable_is_refused_with_a_warning_while_the_drives_are_silent(laboratory):
    laboratory.measure(START)
    laboratory.run(0.1)
    laboratory.are_silent = True
    laboratory.run(0.2)
    laboratory.request("enable")
    laboratory.run(1.0, speed=0.01)
    assert laboratory.node.published["actuators/setpoint_js"] == []
    assert laboratory.states()[-1] == "DISABLED"
    assert laboratory.warnings()[-1] == "enable is refused: it is not known where the drives are"
    assert laboratory.node.published["/diagnostics"][-1].status[0].level == doubles.Message.ERROR


def test_what_was_requested_before_is_not_executed_when_it_is_activated(laboratory):
    laboratory.node.on_deactivate(None)
    laboratory.request("enable")
    laboratory.node.now += 600 * 10**9
    laboratory.node.on_activate(None)
    laboratory.run(0.2, speed=0.01)
    assert laboratory.node.published["actuators/setpoint_js"] == []
    assert laboratory.states()[-1] == "DISABLED"


def test_an_old_reference_stops_the_motion_though_it_arrives_now(laboratory):
    laboratory.request("enable")
    laboratory.run(0.5, speed=0.01)
    laboratory.refer(START, age=80_000_000)
    laboratory.run(0.005)
    assert laboratory.states()[-1] == "PAUSED"


def test_the_tip_has_a_stamp_of_zero_without_markers(laboratory):
    laboratory.request("enable")
    laboratory.run(0.05, speed=0.0)
    image = stamped(
        laboratory.node.now,
        encoding="bgr8",
        width=720,
        height=576,
        step=2160,
        data=bytes(720 * 576 * 3),
    )
    laboratory.node.callbacks["/endoscope/image_raw"](image)
    measured = laboratory.node.published["measured_js"]
    while not laboratory.node.published["hysteresis/delta"]:
        laboratory.run(0.05, speed=0.0)
    assert measured
    assert all(each.header.stamp.sec == each.header.stamp.nanosec == 0 for each in measured)
    assert len(laboratory.node.published["hysteresis/delta"][0].data) == 6


def test_a_stamp_before_1970_ends_nothing(laboratory):
    laboratory.request("enable")
    laboratory.run(0.05, speed=0.0)
    size = {"width": 720, "height": 576, "step": 2160, "data": bytes(720 * 576 * 3)}
    joints = {"name": JOINTS, "position": START}
    for seconds in (-1, -(2**31)):
        for topic, fields in (
            ("/endoscope/image_raw", {"encoding": "bgr8", **size}),
            ("actuators/measured_js", joints),
            ("servo_jp", joints),
        ):
            message = stamped(0, **fields)
            message.header.stamp.sec = seconds
            laboratory.node.callbacks[topic](message)
        while not laboratory.node.published["hysteresis/delta"]:
            laboratory.run(0.05)
        laboratory.node.published["hysteresis/delta"].clear()
    assert laboratory.states()[-1] == "PAUSED"


@pytest.mark.parametrize("end", ["on_deactivate", "on_cleanup", "on_shutdown", "on_error"])
def test_every_end_stops_the_drives_once(laboratory, end):
    laboratory.request("enable")
    laboratory.run(0.2, speed=0.01)
    assert laboratory.texts("actuators/state_command") == []
    assert getattr(laboratory.node, end)(None) == "success"
    assert laboratory.texts("actuators/state_command") == ["pause"]
    assert laboratory.states()[-1] == "DISABLED"
    assert laboratory.node.timers == []
    laboratory.node.stop()
    assert laboratory.texts("actuators/state_command") == ["pause"]
    if end != "on_deactivate":
        assert laboratory.node.callbacks == {}


def test_a_fault_of_the_drives_stops_them_until_it_is_cleared(laboratory):
    laboratory.request("enable")
    laboratory.run(0.2, speed=0.01)
    fault = laboratory.node.callbacks["actuators/operating_state"]
    fault(doubles.Message(state="FAULT"))
    sent = len(laboratory.node.published["actuators/setpoint_js"])
    laboratory.run(0.5, speed=0.01)
    assert len(laboratory.node.published["actuators/setpoint_js"]) == sent
    stops = laboratory.texts("actuators/state_command")
    assert set(stops) == {"pause"}
    assert 5 <= len(stops) <= 7
    for _ in range(100):
        fault(doubles.Message(state="FAULT"))
        laboratory.run(0.1, speed=0.01)
    laboratory.request("enable")
    laboratory.run(0.1, speed=0.01)
    assert len(laboratory.node.published["actuators/setpoint_js"]) > sent


def test_silent_drives_stop_the_node(laboratory):
    laboratory.request("enable")
    laboratory.run(0.2, speed=0.01)
    laboratory.are_silent = True
    laboratory.run(0.2, speed=0.01)
    assert laboratory.states()[-1] == "FAULT"
    assert set(laboratory.texts("actuators/state_command")) == {"pause"}
    assert laboratory.warnings()[-1] == "quick_stop: drive_fault"


def test_bad_messages_are_reported_and_change_nothing(laboratory):
    laboratory.request("enable")
    laboratory.run(0.1, speed=0.0)
    before = laboratory.node.published["actuators/setpoint_js"][-1].position
    laboratory.node.callbacks["servo_jp"](stamped(laboratory.node.now, name=["a"], position=[1.0]))
    laboratory.node.callbacks["/endoscope/image_raw"](stamped(0, encoding="mono8", width=1))
    wrong = stamped(laboratory.node.now, name=["b"], position=[1.0])
    laboratory.node.callbacks["actuators/measured_js"](wrong)
    laboratory.request("home")
    info = doubles.Message(width=640, height=480, k=[0.0] * 9)
    laboratory.node.callbacks["/endoscope/camera_info"](info)
    laboratory.run(0.01)
    assert laboratory.node.published["actuators/setpoint_js"][-1].position == before
    texts = "\n".join(laboratory.node.logged)
    for part in (
        "servo_jp: joints are missing",
        "actuators/measured_js: joints are missing",
        "mono8",
        "home",
        "640 x 480",
    ):
        assert part in texts


@pytest.mark.parametrize(
    ("overrides", "text"),
    [
        ({"config": "missing.toml"}, "missing.toml"),
        ({"joints": ["a", "a", "b"]}, "3 different names"),
        ({"compensation": 2.0}, "compensation"),
    ],
)
def test_a_wrong_parameter_is_refused_and_named(laboratory, monkeypatch, overrides, text):
    monkeypatch.setattr(doubles.Node, "overrides", doubles.Node.overrides | overrides)
    node = InstrumentNode()
    assert node.on_configure(None) == "failure"
    assert text in node.logged[-1]
    assert node.callbacks == {}
    # There is no loop that would refuse it.
    assert node.set_parameter("compensation", 2.0).successful


def test_the_share_of_the_compensation_is_checked(laboratory):
    assert laboratory.node.set_parameter("compensation", 0.5).successful
    refused = laboratory.node.set_parameter("compensation", 1.5)
    assert not refused.successful
    assert "compensation" in refused.reason


class TestAnotherRobot:
    """Two joints, each measured by a topic of its own; and a tracker."""

    JOINTS = ("left", "right")

    @pytest.fixture
    def node(self, tmp_path, monkeypatch):
        topics = [
            {"name": "/left", "type": "JointState"},
            {"name": "/pose", "type": "PoseStamped", "frame": "base"},
        ]
        dof = [{"name": "bend_x", "width_limit": 1.2}, {"name": "bend_y", "width_limit": 1.2}]
        changes = {"dof": dof, "kinematics.kind": "two_planes", "measurement.topics": topics}
        path = tmp_path / "rig.toml"
        path.write_text(dump_config(Config().replace(**changes)))
        overrides = {"config": str(path), "joints": list(self.JOINTS)}
        monkeypatch.setattr(doubles.Node, "overrides", overrides)
        node = InstrumentNode()
        assert node.on_configure(None) == "success"
        assert node.on_activate(None) == "success"
        self.measure(node)
        return node

    def measure(self, node):
        drives = stamped(node.now, name=list(self.JOINTS), position=[0.0, 0.0])
        node.callbacks["actuators/measured_js"](drives)

    def tick(self, node, reference=None):
        if reference is not None:
            message = stamped(node.now, name=list(self.JOINTS), position=list(reference))
            node.callbacks["servo_jp"](message)
        self.measure(node)
        node.timers[0][1]()
        node.now += 5_000_000

    def test_its_joints_are_measured_with_the_stamps_of_the_messages(self, node):
        assert "/endoscope/image_raw" not in node.callbacks
        node.callbacks["state_command"](doubles.Message(string="enable"))
        for number in range(40):
            self.tick(node, [2e-3 * number, 0.0])
            node.callbacks["/left"](stamped(node.now - 10_000_000, name=["bend_x"], position=[0]))
        captured = node.now - 9_000_000
        seen = stamped(captured, name=["bend_x"], position=[0.01])
        node.callbacks["/left"](seen)
        node.callbacks["/left"](seen)  # repeated
        self.tick(node, [0.08, 0.0])
        first, second = node.published["measured_js"][-2:]
        assert first.header.stamp.sec * 10**9 + first.header.stamp.nanosec == captured
        assert first.name == list(self.JOINTS)
        assert first.position[0] == pytest.approx(0.01, abs=0.02)
        assert second.header.stamp.sec == 0
        node.on_deactivate(None)
        assert node.logged[-1].startswith("Tip less reference, RMS: bend_x ")
        (label, _) = node.published["hysteresis/delta"][-1].layout.dim
        assert (label.label, label.size, label.stride) == ("bend_x,bend_y", 2, 4)

    def test_measurements_do_not_pile_up_without_ticks(self, node):
        def measure():
            for _ in range(200):
                node.now += 10_000_000
                node.callbacks["/left"](stamped(node.now, name=["bend_x"], position=[0.0]))

        # Those from before it was activated are dropped.
        node.on_deactivate(None)
        measure()
        node.on_activate(None)
        self.measure(node)
        node.callbacks["state_command"](doubles.Message(string="enable"))
        self.tick(node, [0.0, 0.0])
        assert node.published["hysteresis/delta"] == []
        measure()
        self.tick(node, [0.0, 0.0])
        assert len(node.published["hysteresis/delta"]) == 64

    def test_a_wrong_frame_name_or_time_is_named_and_not_used(self, node):
        node.callbacks["state_command"](doubles.Message(string="enable"))
        self.tick(node, [0.0, 0.0])
        wrong = stamped(node.now)
        wrong.header.frame_id = "tool"
        node.callbacks["/pose"](wrong)
        node.callbacks["/left"](stamped(node.now, name=["left"], position=[0.0]))
        node.callbacks["/left"](stamped(node.now + 10**9, name=["bend_x"], position=[0.0]))
        self.tick(node, [0.0, 0.0])
        assert node.published["measured_js"] == []
        for text, field in zip(
            node.logged[-3:],
            ("/pose header.frame_id", "/left name", "/left header.stamp"),
            strict=True,
        ):
            assert text.startswith(f"{field}: got ")
