"""The node of a robot with [[dof]]: measurements by topics in place of images."""

import re
import runpy
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import tautscope
from common.paths import ROOT
from ros2.peers import JOINTS, Peers, peers
from tautscope.config import load_config
from tautscope.log.reader import read_log
from tautscope.log.replay import replay_same
from tautscope.loop.kinematics import build_kinematics
from tautscope.loop.measurement import Pose
from tautscope.loop.reduction import HysteresisReduction
from tautscope.ros2 import messages, types
from tautscope.ros2.measurements import MeasurementReader
from tautscope.ros2.messages import LOST
from tautscope.ros2.wire import Qos
from test_measurements import Rotation, message

PERIOD = 0.005
HALF_WIDTH = 0.3
"""Of the plays in front of each tip, in its amplitude."""
DELAY = 4
"""Age of a measurement at its arrival [ticks]."""
Calls = list[Callable[[HysteresisReduction], Any]]


@dataclass
class Followed:
    """What a node did, and a loop of Python with the same input beside it."""

    loop: HysteresisReduction
    difference: float = 0.0
    tips: list[np.ndarray] = field(default_factory=list)
    references: list[np.ndarray] = field(default_factory=list)
    statuses: list[str] = field(default_factory=list)


def follow(
    both: Peers,
    ticks: int,
    amplitude: np.ndarray,
    measure: Callable[[int, list[np.ndarray], int], Calls],
) -> Followed:
    """Move plays by a node, and compare its commands with those of a loop of Python.

    `measure` publishes what is measured at the beginning of a tick, and returns the calls by which
    the loop gets the same.
    """
    count = len(amplitude)
    both.delivered(resend=True)
    both.enable(np.zeros(count))
    run, start = both.control.run, both.clock.now
    assert run is not None
    found = Followed(HysteresisReduction(both.config), tips=[np.zeros(count)])
    reference, made_at, calls = np.zeros(count), None, []
    for tick in range(ticks):
        command = found.loop.step(reference, tick * PERIOD, made_at)
        found.references.append(reference)
        found.statuses += [str(call(found.loop).status) for call in calls]
        # The stream begins at the set-point.
        reference = amplitude * np.sin(2.3 * tick * PERIOD) * np.linspace(1.0, 0.8, count)

        def send(
            tick: int = tick, command: np.ndarray = command, moved: np.ndarray = reference
        ) -> None:
            slack = HALF_WIDTH * amplitude
            found.tips.append(np.clip(found.tips[-1], command - slack, command + slack))
            both.send_position(command)
            both.send_reference(moved)
            calls[:] = measure(tick + 1, found.tips, start)
            both.delivered()

        both.clock.before_tick = send
        both.tick()
        made_at = (tick + 1) * PERIOD
        found.difference = max(found.difference, np.abs(run.command - command).max())
    both.clock.before_tick = lambda: None
    return found


def stamp(both: Peers, start: int, tick: int) -> int:
    return both.clock.wall() - both.clock.now + start + round(tick * PERIOD * 1e9)


def test_the_example_publishes_the_pose_of_its_tip() -> None:
    example = runpy.run_path(str(ROOT / "examples" / "ros2" / "catheter.py"))
    bend = np.array([0.4, -0.9])
    position, rotation = example["TwoPlanes"](example["CONFIG"]).tip(bend)
    found = MeasurementReader(example["CONFIG"], 0, "/tracker/pose").read(
        example["pose"](1, position, bend), 0.5
    )
    assert isinstance(found, Pose)
    np.testing.assert_allclose(found.position, position)
    np.testing.assert_allclose(found.orientation, rotation, atol=1e-12)


def test_two_sensors_measure_a_joint_each(tmp_path: Path) -> None:
    changes = {
        "measurement.topics": [
            {"name": "/left", "type": "JointState"},
            {"name": "right", "type": "JointState"},
        ],
        "measurement.delays": [0.005],
    }
    config = tautscope.axes(2, width_limit=1.2).replace(**changes)
    names = [dof.label for dof in config.dofs]
    with peers(config, tmp_path) as both:
        publishers = [both.other.publisher(name, JOINTS) for name in ("/left", "/right")]
        tips = both.other.subscription("/instrument/measured_js", JOINTS, Qos(depth=2000))
        results = both.other.subscription("/instrument/hysteresis/result", "std_msgs/msg/String")

        def measure(tick: int, seen: list[np.ndarray], start: int) -> Calls:
            calls: Calls = []
            for sensor, every in enumerate((4, 3)):
                at = max(tick - DELAY, 0)
                # Repeated, and out of order.
                late = [at, at, max(at - 10, 0)] if tick % 24 == 0 else [at]
                for when in late if tick % every == 0 else ():
                    value = float(seen[when][sensor])
                    publishers[sensor].publish(
                        messages.joint_state(stamp(both, start, when), names[sensor:][:1], [value])
                    )
                    values = np.full(2, np.nan)
                    values[sensor] = value
                    calls.append(
                        lambda loop, sensor=sensor, values=values, at=when * PERIOD: loop.on_tip(
                            values, at, sensor=sensor
                        )
                    )
            return calls

        found = follow(both, 340, np.ones(2), measure)
        assert found.difference < 1e-9
        run = both.control.run
        assert run is not None
        np.testing.assert_allclose(run.loop.delta_plus - run.loop.delta_minus, 0.6, rtol=0.15)
        stamps = [tip.header.stamp.sec for tip in both.drain(tips)]
        lost = [status for status in found.statuses if status in LOST]
        assert len(stamps) >= len(found.statuses) - 7
        assert abs(stamps.count(0) - len(lost)) <= 2
        assert len(lost) > 10
        both.request("disable")
        result = both.received(results, "result").data
        assert re.fullmatch(
            rf"Tip less reference, RMS: {names[0]} \S+ rad, slack found 0\.\d+ rad; "
            rf"{names[1]} \S+ rad, slack found 0\.\d+ rad",
            result,
        ), result
        same, _ = replay_same(read_log(run.path))
        assert same.is_identical
        error = np.array(found.tips[1:])[240:] - np.array(found.references)[240:]
        assert (np.sqrt((error**2).mean(axis=0)) < 0.5 * HALF_WIDTH).all()


def test_the_tip_of_a_colonoscope_is_measured_by_its_pose(tmp_path: Path) -> None:
    changes = {"measurement.topics": [{"name": "/tracker/pose", "type": "PoseStamped"}]}
    config = load_config("colonoscope").replace(**changes)
    kinematics = build_kinematics(config)
    assert kinematics is not None
    with peers(config, tmp_path) as both:
        poses = both.other.publisher("/tracker/pose", "geometry_msgs/msg/PoseStamped")
        tips = both.other.subscription("/instrument/measured_js", JOINTS, Qos(depth=2000))
        begun: list[int] = []

        def measure(tick: int, seen: list[np.ndarray], start: int) -> Calls:
            begun.append(start)
            if tick % 5:
                return []
            at = max(tick - DELAY, 0)
            position, rotation = kinematics.tip(seen[at])
            quaternion = Rotation.from_matrix(rotation).as_quat()
            for frame in ("base", "tool") if tick == 200 else ("base",):
                sent = message("PoseStamped", position.tolist(), quaternion, frame=frame)
                sent.header.stamp = types.stamp(stamp(both, start, at))
                poses.publish(sent)
            return [lambda loop: loop.on_pose(position, at * PERIOD, rotation)]

        found = follow(both, 300, np.array([1.0, 1.0, 0.01]), measure)
        assert found.difference < 1e-6
        run = both.control.run
        assert run is not None
        assert 0 <= run.loop.updates - found.loop.updates <= 1
        # The stamp of what is published is that of the pose.
        last = both.drain(tips)[-1]
        at = last.header.stamp.sec * 10**9 + last.header.stamp.nanosec - stamp(both, begun[0], 0)
        np.testing.assert_allclose(last.position, found.tips[round(at / PERIOD / 1e9)], atol=0.02)
        warned = [each.data for each in both.drain(both.warnings)]
        assert any(each.startswith("refused: /tracker/pose header.frame_id") for each in warned)


def test_a_gamepad_moves_another_robot(tmp_path: Path) -> None:
    changes = {"measurement.topics": [{"name": "/tracker/pose", "type": "PoseStamped"}]}
    config = load_config("colonoscope").replace(**changes)
    kind = "sensor_msgs/msg/Joy"
    with peers(config, tmp_path, device="joy") as both:
        joy = both.other.publisher("/joy", kind)
        both.delivered(resend=True)
        both.enable(np.zeros(3))
        pressed = [0, 0, *[1] * 40]

        def send() -> None:
            both.send_position(np.zeros(3))
            held = pressed.pop(0)
            axes = np.array([0.5 * held, 0, 0, 0, 0], np.float32)
            buttons = np.array([0, 0, 0, 0, held], np.int32)
            header = types.header(both.clock.wall(), "")
            joy.publish({"header": header, "axes": axes, "buttons": buttons})
            both.delivered()

        both.clock.before_tick = send
        while pressed:
            both.tick()
        assert both.control.run is not None
        moved = both.control.run.reference
        assert moved[1] > 0  # axis 0 is the second degree of freedom
        assert moved[0] == moved[2] == 0
