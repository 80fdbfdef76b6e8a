"""Logs of robots with [[dof]]: any number of degrees of freedom, and any sensors."""

from collections.abc import Iterable, Sequence
from dataclasses import astuple, replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from play_rig import (
    Sensor,
    SensorRig,
    TrackedPlanes,
    by_joints,
    by_points,
    by_position,
    by_quaternion,
)
from rosbags.highlevel import AnyReader
from tautscope import HysteresisReduction, PlayRig, Pose, Tip
from tautscope.commands.robot import bytes_per_second
from tautscope.config import Config, Sine, axes, load_config
from tautscope.errors import ConfigError, RecordError
from tautscope.log import stored_run, topics
from tautscope.log.alignment import align_recording
from tautscope.log.export import export_csv, recover
from tautscope.log.fields import multi_array
from tautscope.log.header import header_messages, read_header
from tautscope.log.messages import Clock, Codec
from tautscope.log.reader import Tick, Update, read_log
from tautscope.log.replay import estimate_from_log, replay_same
from tautscope.log.stored_run import read_run
from tautscope.log.writer import LogWriter
from tautscope.loop.measurement import Measurement
from tautscope.loop.references import OperatorMotion
from tautscope.loop.rig import Sample
from tautscope.runs.experiment import run_experiment
from tautscope.runs.recording import Recording, per_dof

SECONDS = 1.0
MIXED = (by_joints, by_quaternion, by_position, by_points)


def arm() -> Config:
    config = axes(2, width_limit=1.0, names=["turn", "reach"])
    return config.replace(**{"kinematics.kind": "play_rig:Arm", "measurement.delays": [0.01]})


def record(path: Path, config: Config, sensors: Sequence[Sensor] = (by_joints,)) -> Recording:
    sines = [Sine(centre=0.0, amplitude=0.8 * dof.width_limit) for dof in config.dof]
    with LogWriter(path, config, wait=True) as log:
        motion = OperatorMotion(sines, 3, SECONDS)
        return run_experiment(SensorRig(config, sensors), motion, config, log=log)


@pytest.fixture(scope="module")
def mixed(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Recording]:
    path = tmp_path_factory.mktemp("mixed") / "run.mcap"
    return path, record(path, arm(), MIXED)


@pytest.fixture(scope="module")
def tracked(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Recording]:
    path, config = tmp_path_factory.mktemp("tracked") / "run.mcap", load_config("colonoscope")
    return path, record(path, config, (TrackedPlanes(config),))


def assert_replays(path: Path, run: Recording) -> None:
    log = read_log(path)
    found, again = replay_same(log)
    assert found.first_difference == found.ended == ""
    assert found.same_ticks == len(run.trace) > 100
    assert found.same_updates == len(run.frames) >= 40
    for recording in (again, log.recording()):
        for name in ("trace", "frames"):
            table, expected = getattr(recording, name), getattr(run, name)
            assert table.dtype == expected.dtype
            assert table.tobytes() == expected.tobytes(), name


@pytest.mark.parametrize("count", [1, 8])
def test_a_run_needs_no_more_room_than_is_announced(tmp_path: Path, count: int) -> None:
    record(tmp_path / "run.mcap", axes(count, width_limit=1.0)).write(tmp_path)
    size = sum(file.stat().st_size for file in tmp_path.iterdir())
    assert 0.5 < size / (bytes_per_second(count) * SECONDS) < 1.0


@pytest.mark.parametrize("count", [1, 5, 8])
def test_a_run_of_any_number_of_dofs_replays_to_the_bit(tmp_path: Path, count: int) -> None:
    run = record(tmp_path / "run.mcap", axes(count, width_limit=1.0))
    assert_replays(tmp_path / "run.mcap", run)


def test_a_run_with_a_tracker_replays_to_the_bit(tracked: tuple[Path, Recording]) -> None:
    assert_replays(*tracked)


def test_a_run_of_several_sensors_replays_to_the_bit(mixed: tuple[Path, Recording]) -> None:
    assert_replays(*mixed)


class Silent(PlayRig):
    """Its sensor measures from a time to another [s]."""

    times = 0.0, 2.0

    def measure(self, tip: NDArray[np.float64], time: float) -> Iterable[Measurement]:
        first, last = self.times
        return super().measure(tip, time) if first <= time <= last else ()


@pytest.mark.parametrize("times", [(0.0, 2.0), (99.0, 99.0), (1.5, 99.0)])
def test_a_sensor_that_falls_silent_is_in_the_warnings_of_run_and_log(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, times: tuple[float, float]
) -> None:
    monkeypatch.setattr(Silent, "times", times)
    config, path = axes(1, width_limit=1.2, range=(-2, 2)), tmp_path / "run.mcap"
    motion = OperatorMotion([Sine(centre=0.0, amplitude=1.0)], 3, 14.0)
    with LogWriter(path, config, wait=True) as log:
        run = run_experiment(Silent(config), motion, config, log=log)
    line, stored = (
        next(line for line in warnings if line.startswith("dropped ("))
        for warnings in (run.warnings, read_run(path).main.warnings)
    )
    assert stored == line
    is_lasting = times[1] < 99 or times[0] == 99
    assert line.endswith("the compensation faded out meanwhile") == is_lasting
    assert ("also at its end" in line) == is_lasting


@pytest.mark.parametrize("profile", ["best", "paper"])
def test_before_a_measurement_the_recorded_offsets_are_those_in_use(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, profile: str
) -> None:
    monkeypatch.setattr(Silent, "times", (99.0, 99.0))
    config = axes(2, width_limit=[1.2, 0.5], range=(-2, 2)).replace(profile=profile)
    motion = OperatorMotion([Sine(centre=0.0, amplitude=0.4)] * 2, 3, 1.5)
    with LogWriter(tmp_path / "run.mcap", config, wait=True) as log:
        run = run_experiment(Silent(config), motion, config, log=log)
    offsets = HysteresisReduction(config).delta_plus
    assert (offsets > 0).all() == (profile == "best")
    for each in (run, read_run(tmp_path / "run.mcap").main):
        recorded = per_dof(each.trace, "delta_plus", config.dof)
        np.testing.assert_array_equal(recorded, np.broadcast_to(offsets, recorded.shape))


def test_measurements_that_only_the_log_lacks_are_not_called_missing(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    record(tmp_path / "run.mcap", axes(1, width_limit=1.0))
    log = read_log(tmp_path / "run.mcap")
    for index, event in [*log.events.items()][:-20]:
        if isinstance(event, Update) and event.row["arrived_at"] > 0.5:
            del log.events[index]
    monkeypatch.setattr(stored_run, "read_log", lambda path: log)
    monkeypatch.setattr(stored_run, "LEAST_DURATION", 0.9)
    warnings = read_run(tmp_path / "run.mcap").main.warnings
    assert [line for line in warnings if "not in run.mcap" in line]
    assert not [line for line in warnings if line.startswith("dropped")]


def test_a_changed_measurement_is_found(mixed: tuple[Path, Recording]) -> None:
    log = read_log(mixed[0])
    index, update = next(
        (index, event)
        for index, event in log.events.items()
        if index > 100 and isinstance(event, Update) and isinstance(event.measurement, Tip)
    )
    values = np.nextafter(np.asarray(update.measurement.values), 1e9)
    log.events[index] = replace(update, measurement=replace(update.measurement, values=values))
    found, _ = replay_same(log)
    count = sum(isinstance(log.events[each], Update) for each in range(1, index + 1))
    assert found.first_difference.startswith(f"measurement {count}: ")
    assert topics.UPDATE in found.first_difference


def test_another_configuration_gives_other_estimates(mixed: tuple[Path, Recording]) -> None:
    log = read_log(mixed[0])
    doubted = log.config.replace(**{"measurement.tip_deviation": 0.3})
    replayed, skipped = estimate_from_log(log, doubted)
    assert skipped == 0
    assert len(replayed.frames) == len(mixed[1].frames)
    assert replayed.trace["delta_plus_turn"][-1] != mixed[1].trace["delta_plus_turn"][-1]
    with pytest.raises(ConfigError, match=r"dof: got 'axis_1, axis_2'.*turn, reach"):
        estimate_from_log(log, axes(2, width_limit=1.0))


def test_the_delay_of_images_needs_images(mixed: tuple[Path, Recording]) -> None:
    with pytest.raises(RecordError, match="calibrate latency --rig"):
        align_recording(read_log(mixed[0]).recording())


def test_other_readers_see_names_and_numbers(mixed: tuple[Path, Recording]) -> None:
    """Read with rosbags, whose definitions of the messages are not ours."""
    seen: dict[str, list[object]] = {}
    with AnyReader([mixed[0]]) as reader:
        for connection, _, raw in reader.messages():
            message = reader.deserialize(raw, connection.msgtype)
            seen.setdefault(connection.topic, []).append(message)
    assert topics.CAMERA_INFO not in seen
    assert all(each.name == ["turn", "reach"] for each in seen[topics.COMMAND])
    labels = {tuple(side.label for side in each.layout.dim) for each in seen[topics.MEASUREMENT]}
    assert labels == {
        ("tip", "captured_at,sensor,turn,reach"),
        ("pose", "captured_at,sensor,x,y,z,q_x,q_y,q_z,q_w"),
        ("pose", "captured_at,sensor,x,y,z"),
        ("points", "captured_at,sensor,u_0,v_0,u_1,v_1"),
    }
    of_poses = [each for each in seen[topics.MEASUREMENT] if each.layout.dim[1].size == 9]
    turned = [each for each in seen[topics.POSE] if each.header.frame_id == "sensor_1"]
    for array, pose in zip(of_poses, turned, strict=True):
        at, orientation = pose.pose.position, pose.pose.orientation
        given = [at.x, at.y, at.z, orientation.x, orientation.y, orientation.z, orientation.w]
        np.testing.assert_allclose(given, array.data[2:], atol=1e-12)
    update = seen[topics.UPDATE][-1]
    assert "estimate_turn" in update.layout.dim[0].label.split(",")


def test_a_pose_by_a_matrix_is_shown_as_its_quaternion(tracked: tuple[Path, Recording]) -> None:
    for event in read_log(tracked[0]).events.values():
        if not isinstance(event, Update):
            continue
        assert isinstance(event.measurement, Pose)
        shown = topics.decode(topics.POSE, event.raw[topics.POSE]).pose.orientation
        x, y, z, w = (getattr(shown, name) for name in "xyzw")
        # A vector v is turned by v + 2 w (u x v) + 2 u x (u x v), with u = (x, y, z).
        u, matrix = np.array([x, y, z]), np.asarray(event.measurement.orientation)
        for vector, expected in zip(np.eye(3), matrix.T, strict=True):
            across = np.cross(u, vector)
            np.testing.assert_allclose(
                vector + 2 * (w * across + np.cross(u, across)), expected, atol=1e-9
            )


def test_a_log_that_is_cut_reads_up_to_the_cut(
    mixed: tuple[Path, Recording], tmp_path: Path
) -> None:
    """The journal writes chunks; those before the cut are whole, in the order of the loop."""
    path = tmp_path / "slow.mcap"
    config = arm().replace(**{"recording.flush_period": 0.01})
    run = record(path, config, MIXED)
    complete, cut = path.read_bytes(), tmp_path / "cut.mcap"
    rng, before = np.random.default_rng(0), 0
    begin = len(complete) // 4
    for end in sorted(rng.integers(begin, len(complete), 6)):
        cut.write_bytes(complete[:end])
        log = read_log(cut)
        assert log.damage.is_truncated
        count = len(log.events)
        assert list(log.events) == list(range(1, count + 1))
        assert count >= before
        before = count
        ticks = [event for event in log.events.values() if isinstance(event, Tick)]
        frames = log.recording().frames
        for name in ("captured_at", "estimate_turn", "estimate_reach"):
            assert frames[name].tobytes() == run.frames[name][: len(frames)].tobytes()
        np.testing.assert_array_equal(
            [tick.sample.time for tick in ticks], run.trace["time"][: len(ticks)]
        )
    assert before > 0
    recover(cut, tmp_path / "repaired.mcap")
    assert list(read_log(tmp_path / "repaired.mcap").events) == list(log.events)


def test_tables_have_columns_by_name(mixed: tuple[Path, Recording], tmp_path: Path) -> None:
    export_csv(mixed[0], tmp_path / "csv")
    titles = (tmp_path / "csv" / "trace.csv").read_text().splitlines()[0].split(",")
    assert [name for name in titles if name.startswith("command")] == [
        "command_turn",
        "command_reach",
    ]
    again = Recording.load(tmp_path / "csv")
    assert again.trace.tobytes() == mixed[1].trace.tobytes()
    assert again.frames.tobytes() == mixed[1].frames.tobytes()


CLOCK = Clock(0.0, 10**18)


def update_of(config: Config, measurement: Measurement) -> dict[str, bytes]:
    loop = HysteresisReduction(config)
    loop.step(np.zeros(len(config.dof)), 0.0)
    return Codec(config).update(CLOCK, 0.0, measurement, loop.on_sample(measurement), 1)


def test_names_that_do_not_fit_are_refused() -> None:
    wrist, other = arm(), axes(2, width_limit=1.0)
    tick = Codec(other).tick(CLOCK, Sample(0.0, np.zeros(2)), np.zeros(2), np.zeros(2))
    with pytest.raises(RecordError, match=f"{topics.REFERENCE}: got 'axis_1, axis_2'.*turn, reach"):
        Codec(wrist).read_tick(tick)
    theirs, ours = (update_of(each, Tip([0.1, 0.2], 0.0)) for each in (other, wrist))
    with pytest.raises(RecordError, match=f"{topics.DELTA}: got 'axis_1, axis_2'"):
        Codec(wrist).read_update(theirs)
    mixed = ours | {topics.MEASUREMENT: theirs[topics.MEASUREMENT]}
    with pytest.raises(
        RecordError, match=f"{topics.MEASUREMENT}: got 'tip captured_at,sensor,axis_1"
    ):
        Codec(wrist).read_update(mixed)
    *_, measurement = Codec(wrist).read_update(ours)
    assert isinstance(measurement, Tip)
    assert [*map(str, astuple(measurement))] == [*map(str, astuple(Tip(np.array([0.1, 0.2]), 0.0)))]


@pytest.mark.parametrize(
    ("labels", "count"),
    [
        (("pose", "captured_at,sensor,x,y,z,q_x"), 6),
        (("points", "captured_at,sensor,u_0,v_0,u_1"), 5),
        (("force", "captured_at,sensor,x,y,z"), 5),
        (("tip", "captured_at"), 1),
    ],
)
def test_a_measurement_of_another_kind_is_refused(labels: tuple[str, str], count: int) -> None:
    messages = update_of(arm(), Tip([0.1, 0.2], 0.0))
    array = multi_array({labels[0]: 1, labels[1]: count}, [0.5] * count)
    messages[topics.MEASUREMENT] = topics.encode(topics.MEASUREMENT, array)
    with pytest.raises(RecordError, match=f"{topics.MEASUREMENT}: got '{labels[0]} captured_at"):
        Codec(arm()).read_update(messages)


def test_a_log_has_at_most_eight_dofs() -> None:
    header = header_messages(axes(8, width_limit=1.0), True, (), 0)
    text = topics.decode(topics.CONFIG, header[topics.CONFIG]).data
    ninth = '\n[[dof]]\nname = "ninth"\nwidth_limit = 1.0\n'
    header[topics.CONFIG] = topics.encode(topics.CONFIG, {"data": text + ninth})
    with pytest.raises(ConfigError, match="dof: got '9 entries'"):
        read_header(header)
