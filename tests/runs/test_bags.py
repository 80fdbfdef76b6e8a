"""ROS 2 bags as tables: topics, times, damage. The bags are of rosbags' own Writer."""

import re
import sqlite3
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bag_files import (
    START,
    STORAGES,
    TYPES,
    header,
    joint_state,
    make,
    pose,
    pose_stamped,
    vector,
    write_bag,
)
from play_model import play
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from tautscope.analysis.verdict import judge
from tautscope.errors import RecordError
from tautscope.runs.columns import list_columns
from tautscope.runs.records import read_record
from tautscope.runs.tables import open_table, read_table

OWN = "my_msgs/msg/Own"
COUNT = 200
MOTOR = 2 * np.sin(np.arange(COUNT) / 9)
TIMES = [START + 10_000_000 * k for k in range(COUNT)]
TURN = 0.4 * np.sin(np.arange(COUNT) / 9)


def covariance_pose(stamp: int, position: Any) -> Any:
    inner = make(
        "geometry_msgs/msg/PoseWithCovariance", pose=pose(position), covariance=np.ones(36)
    )
    kind = "geometry_msgs/msg/PoseWithCovarianceStamped"
    return make(kind, header=header(stamp), pose=inner)


def point(stamp: int, position: Any) -> Any:
    kind = "geometry_msgs/msg/PointStamped"
    return make(kind, header=header(stamp), point=vector("Point", position))


def transform(stamp: int, position: Any, rotation: Any) -> Any:
    inner = make(
        "geometry_msgs/msg/Transform",
        translation=vector("Vector3", position),
        rotation=vector("Quaternion", rotation),
    )
    kind = "geometry_msgs/msg/TransformStamped"
    one = make(kind, header=header(stamp, "base"), child_frame_id="tip", transform=inner)
    return make("tf2_msgs/msg/TFMessage", transforms=[one])


def floats(values: Any) -> Any:
    layout = make("std_msgs/msg/MultiArrayLayout", dim=[], data_offset=0)
    return make("std_msgs/msg/Float64MultiArray", layout=layout, data=np.array(values, float))


@pytest.mark.parametrize("storage", STORAGES)
def test_topics_of_all_types_are_columns(storage: str, tmp_path: Path) -> None:
    axis = np.array([2.0, -1.0, 2.0]) / 3
    turns = [(*(np.sin(a / 2) * axis), np.cos(a / 2)) for a in TURN]
    image = make(
        "sensor_msgs/msg/CompressedImage",
        header=header(START),
        format="jpeg",
        data=np.zeros(9, np.uint8),
    )
    topics: dict[str, list[Any]] = {
        "/joint_states": [
            joint_state(t, {"m": m, "r": -m}) for t, m in zip(TIMES, MOTOR, strict=True)
        ],
        "/tip": [
            pose_stamped(t, (m, 0, 0), q) for t, m, q in zip(TIMES, MOTOR, turns, strict=True)
        ],
        "/cov": [covariance_pose(t, (m, 2 * m, 2 * m)) for t, m in zip(TIMES, MOTOR, strict=True)],
        "/point": [point(t, (0, 0, m)) for t, m in zip(TIMES, MOTOR, strict=True)],
        "/tf": [transform(t, (0, m, 0), q) for t, m, q in zip(TIMES, MOTOR, turns, strict=True)],
        "/command": [floats((m, 7.0)) for m in MOTOR],
        "/image": [image for _ in MOTOR],
    }
    rows = {topic: list(zip(TIMES, some, strict=True)) for topic, some in topics.items()}
    bag = write_bag(tmp_path / "bag", storage, rows)
    sheet = open_table(bag)
    assert not any("image" in title or "covariance" in title for title in sheet.titles)
    for title, values in {
        "/joint_states/m/position": MOTOR,
        "/joint_states/r/position": -MOTOR,
        "/tip/pose/position/x": MOTOR,
        "/cov/pose/pose/position/travel": 3 * (MOTOR - MOTOR[0]),
        "/point/point/z": MOTOR,
        "/tf/base/tip/translation/y": MOTOR,
        "/command/data.1": MOTOR,
        "/tip/pose/orientation/turn": TURN - TURN[0],
        "/tf/base/tip/rotation/turn": TURN - TURN[0],
    }.items():
        found = sheet.read([title, "time"])
        np.testing.assert_allclose(found.columns[title], values, atol=1e-9, err_msg=title)
        np.testing.assert_allclose(found.columns["time"], np.arange(COUNT) * 0.01, atol=1e-9)
    units = {title: sheet.unit(k) for k, title in enumerate(sheet.titles)}
    assert units["/tip/pose/position/x"] == units["/tip/pose/position/travel [m]"] == "m"
    assert units["/tip/pose/orientation/turn [rad]"] == "rad"
    assert units["/joint_states/m/position"] == ""


def test_a_single_file_of_a_bag_is_read(tmp_path: Path) -> None:
    for storage in STORAGES:
        rows = [(t, joint_state(t, {"m": m})) for t, m in zip(TIMES, MOTOR, strict=True)]
        bag = write_bag(tmp_path / storage, storage, {"/joint_states": rows})
        [file] = bag.glob(f"*.{storage}")
        name = "/joint_states/m/position"
        np.testing.assert_array_equal(read_table(file, [name]).columns[name], MOTOR)


@pytest.mark.parametrize("stamps", ["headers", "none", "another clock"])
def test_times_are_of_the_headers_if_these_are_of_the_clock_of_the_recording(
    stamps: str, tmp_path: Path
) -> None:
    """The recorder gets each message up to 30 ms late."""
    late = np.random.default_rng(0).integers(0, 30_000_000, COUNT)
    logged = [t + 30_000_000 * k + int(d) for k, (t, d) in enumerate(zip(TIMES, late, strict=True))]
    true = [t + 30_000_000 * k for k, t in enumerate(TIMES)]
    given = {
        "headers": true,
        "none": [None] * COUNT,
        "another clock": [t - START + 1 for t in true],
    }
    rows = [
        (t, joint_state(stamp, {"m": m}))
        for t, stamp, m in zip(logged, given[stamps], MOTOR, strict=True)
    ]
    found = read_table(write_bag(tmp_path / "bag", "mcap", {"/j": rows}), ["time"]).columns["time"]
    expected = np.array(true if stamps == "headers" else logged)
    np.testing.assert_allclose(found, (expected - expected[0]) / 1e9, atol=1e-6)


def test_topics_at_different_rates_become_a_record_of_the_tip(tmp_path: Path) -> None:
    """A third topic, of which the record has nothing, changes no count."""
    seen = [START + 5_000_000 + 37_000_000 * k for k in range(40)]
    topics = {
        "/joint_states": [(t, joint_state(t, {"m": m})) for t, m in zip(TIMES, MOTOR, strict=True)],
        "/tip": [(t, pose_stamped(t, (k, 0, 0))) for k, t in enumerate(seen)],
        "/other": [(t + 1, point(t, (0, 0, 1))) for t in TIMES],
    }
    bag = write_bag(tmp_path / "bag", "mcap", topics)
    columns = "/joint_states/m/position", "/tip/pose/position/x"
    record = read_record(bag, *columns, "time")
    is_seen = np.isfinite(record.measured)
    assert record.cleaning.interpolated == is_seen.sum() == len(seen)
    assert record.cleaning.blank == 0
    at = (np.array(seen) - START) / 1e9
    expected = np.interp(at, np.arange(COUNT) * 0.01, MOTOR)
    np.testing.assert_allclose(record.command[is_seen], expected, atol=1e-9)
    assert record.units == ("", "m")


def test_a_bag_of_the_tip_keeps_its_time(tmp_path: Path) -> None:
    """The recording of the tip begins 0.3 s later than that of the motors."""
    motors = [(t, joint_state(t, {"m": m})) for t, m in zip(TIMES, MOTOR, strict=True)]
    tips = [(t, point(t, (m, 0, 0))) for t, m in zip(TIMES[30:], MOTOR[30:], strict=True)]
    files = [
        write_bag(tmp_path / "motors", "mcap", {"/j": motors}),
        write_bag(tmp_path / "tips", "mcap", {"/tip": tips}),
    ]
    columns = "/j/m/position", "/tip/point/x", "time"
    record = read_record(files[0], *columns, tip_path=files[1])
    seen = np.isfinite(record.measured)
    np.testing.assert_array_equal(record.measured[seen], MOTOR[30:])
    np.testing.assert_allclose(record.command[seen], MOTOR[30:], atol=1e-9)


def test_columns_of_a_bag_are_listed_and_pairs_proposed(tmp_path: Path) -> None:
    topics = {
        "/joint_states": [(t, joint_state(t, {"m": m})) for t, m in zip(TIMES, MOTOR, strict=True)],
        "/tip": [
            (t, pose_stamped(t, (m, 0.1 * m, 1)))
            for t, m in zip(TIMES[::3], MOTOR[::3], strict=True)
        ],
    }
    columns, pairs, _ = list_columns(open_table(write_bag(tmp_path / "bag", "db3", topics)))
    found = {column.title: column for column in columns}
    assert found["/tip/pose/position/x"].count == len(TIMES[::3])
    assert found["/joint_states/m/position"].largest == MOTOR.max()
    command = {command for command, _ in pairs}
    assert command == {"/joint_states/m/position"}
    assert {tip.rpartition("/")[0] for _, tip in pairs} == {"/tip/pose/position"}


@pytest.mark.parametrize("storage", STORAGES)
def test_a_bag_gives_the_verdict_of_a_csv_of_the_same_data(storage: str, tmp_path: Path) -> None:
    """Motor at 100 Hz, tip at 27 Hz."""
    rng = np.random.default_rng(1)
    at = 10_000_000 * np.arange(4000)
    command = 10 * np.sin(at / 1e9) + 5 * np.sin(2.7 * at / 1e9)
    seen = 3_000_000 + 37_000_000 * np.arange(1080)
    true = np.interp(seen, at, play(command, -1.5, 1.5))
    tip = true + rng.normal(0, 0.05, len(seen))
    topics = {
        "/joint_states": [
            (START + t, joint_state(START + t, {"m": c}))
            for t, c in zip(at.tolist(), command, strict=True)
        ],
        "/tip": [
            (START + t, pose_stamped(START + t, (0, 1e-3 * y, 0)))
            for t, y in zip(seen.tolist(), tip, strict=True)
        ],
    }
    lines = [f"{t / 1e9!r},{c!r}," for t, c in zip(at.tolist(), command.tolist(), strict=True)]
    lines += [
        f"{t / 1e9!r},,{1e-3 * y!r}" for t, y in zip(seen.tolist(), tip.tolist(), strict=True)
    ]
    lines.sort(key=lambda line: float(line.split(",")[0]))
    (tmp_path / "record.csv").write_text("time,motor,tip [m]\n" + "\n".join(lines) + "\n")
    bag = write_bag(tmp_path / "bag", storage, topics)
    columns = "/joint_states/m/position", "/tip/pose/position/y"
    found = judge(read_record(bag, *columns, "time"))
    expected = judge(read_record(tmp_path / "record.csv", "motor", "tip", "time"))
    assert found.found.is_identified
    assert found.found.width.low < 3e-3 < found.found.width.high
    assert found.text == expected.text


def damaged(whole: Path, how: str, storage: str) -> Path:
    [file] = whole.glob(f"*.{storage}")
    if how == "empty folder":
        for each in whole.iterdir():
            each.unlink()
    elif how == "no metadata.yaml":
        (whole / "metadata.yaml").unlink()
    elif how == "no file":
        file.unlink()
    elif how == "metadata.yaml is cut off":
        text = (whole / "metadata.yaml").read_text()
        (whole / "metadata.yaml").write_text(text[: len(text) // 2])
    elif how == "empty":
        file.write_bytes(b"")
    else:
        file.write_bytes(file.read_bytes()[: file.stat().st_size * 2 // 3])
    return whole


@pytest.mark.parametrize("storage", STORAGES)
@pytest.mark.parametrize(
    ("how", "message"),
    [
        ("empty folder", "metadata.yaml: got 'no such file', expected a ROS 2 bag"),
        ("no metadata.yaml", "metadata.yaml: got 'no such file'.*or one .mcap or .db3 file"),
        ("no file", "Some database files are missing"),
        ("metadata.yaml is cut off", "bag: got '.*expected a ROS 2 bag.*complete"),
        ("empty", "bag: got ['\"].*expected a ROS 2 bag.*complete"),
        ("truncated", "bag: got '.*expected a ROS 2 bag.*complete"),
    ],
)
def test_damage_is_named(how: str, message: str, storage: str, tmp_path: Path) -> None:
    rows = [(t, joint_state(t, {"m": m})) for t, m in zip(TIMES, MOTOR, strict=True)]
    bag = damaged(write_bag(tmp_path / "bag", storage, {"/j": rows}), how, storage)
    with pytest.raises(RecordError, match=message):
        open_table(bag)


def test_a_topic_of_two_types_has_the_columns_of_both(tmp_path: Path) -> None:
    with Writer(tmp_path / "bag", version=9, storage_plugin=StoragePlugin.MCAP) as bag:
        for at, message in ((0, joint_state(0, {"m": 1.0})), (1, pose_stamped(0, (2.0, 3.0, 4.0)))):
            topic = bag.add_connection("/x", message.__msgtype__, typestore=TYPES)
            bag.write(topic, START + at, TYPES.serialize_cdr(message, message.__msgtype__))
    columns, _, _ = list_columns(open_table(tmp_path / "bag"))
    titles = [column.title for column in columns]
    assert "/x/m/position" in titles
    assert "/x/pose/position/x" in titles


def test_own_types_are_read_by_their_definition_in_the_bag(tmp_path: Path) -> None:
    with Writer(tmp_path / "bag", version=9, storage_plugin=StoragePlugin.MCAP) as bag:
        own = get_typestore(Stores.EMPTY)
        own.register(get_types_from_msg("float64 x\nfloat32[3] forces\n", OWN))
        topic = bag.add_connection("/own", OWN, typestore=own)
        for k, t in enumerate(TIMES):
            message = own.types[OWN](x=k / 2, forces=np.ones(3, np.float32))
            bag.write(topic, t, own.serialize_cdr(message, OWN))
    found = read_table(tmp_path / "bag", ["/own/x", "/own/forces.3"]).columns
    np.testing.assert_array_equal(found["/own/x"], np.arange(COUNT) / 2)
    np.testing.assert_array_equal(found["/own/forces.3"], 1.0)


def test_topics_of_unknown_types_are_named(tmp_path: Path) -> None:
    """As in a bag of Humble or older, which has no definitions of types."""
    bag = write_bag(tmp_path / "bag", "db3", {"/own": [(t, floats([1.0])) for t in TIMES]})
    [file] = bag.glob("*.db3")
    with closing(sqlite3.connect(file)) as base, base:
        base.execute("DELETE FROM message_definitions")
        base.execute("UPDATE topics SET type = ?", [OWN])
    text = re.sub(r"type_description_hash:\s*\S+", "", (bag / "metadata.yaml").read_text())
    (bag / "metadata.yaml").write_text(text.replace("std_msgs/msg/Float64MultiArray", OWN))
    with pytest.raises(RecordError, match=f"topics: got '/own of {OWN}', expected one with num"):
        open_table(bag)
