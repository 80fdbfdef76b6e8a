"""The layout of Foxglove: every path in it is in a log, with the type that its panel shows."""

import json
import re
from collections.abc import Iterator
from typing import Any

import foxglove_layout
import pytest
from drawn import short_experiment
from recorded import record
from rosbags.highlevel import AnyReader
from tautscope.log import topics

LAYOUT = json.loads(foxglove_layout.LAYOUT.read_text(encoding="utf-8"))
PANELS: dict[str, dict[str, Any]] = LAYOUT["configById"]
SHOWN = {
    "imageTopic": "sensor_msgs/msg/CompressedImage",
    "calibrationTopic": "sensor_msgs/msg/CameraInfo",
    "DiagnosticSummary": "diagnostic_msgs/msg/DiagnosticArray",
    "RosOut": "rcl_interfaces/msg/Log",
}
"""What these panels of Foxglove show."""
NOT_ALWAYS = {topics.EVENT: "std_msgs/msg/String", topics.WARNING: "rcl_interfaces/msg/Log"}
"""Topics that a short run need not have."""


@pytest.fixture(scope="module")
def messages(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """Topic -> its last message in a log, by rosbags."""
    path = tmp_path_factory.mktemp("layout") / "run.mcap"
    record(path, short_experiment(), 0.5)
    with AnyReader([path]) as reader:
        return {
            connection.topic: reader.deserialize(raw, connection.msgtype)
            for connection, _, raw in reader.messages()
        }


def series() -> Iterator[tuple[str, str, str]]:
    """Panel, path and source of time of each series."""
    for panel, config in PANELS.items():
        for each in config.get("paths", ()):
            yield panel, each["value"], each["timestampMethod"]


def test_the_file_is_up_to_date() -> None:
    assert foxglove_layout.LAYOUT.read_text(encoding="utf-8") == foxglove_layout.layout(), (
        "run `uv run docs/foxglove_layout.py`"
    )


def test_every_panel_is_placed_once() -> None:
    def leaves(node: Any) -> list[str]:
        if isinstance(node, str):
            return [node]
        assert node["direction"] in ("row", "column")
        assert 0 < node["splitPercentage"] < 100
        return leaves(node["first"]) + leaves(node["second"])

    assert sorted(leaves(LAYOUT["layout"])) == sorted(PANELS)


def test_every_series_is_a_value_in_a_log(messages: dict[str, Any]) -> None:
    found = list(series())
    assert len(found) == 3 * (5 + 2) + 2
    for panel, path, time in found:
        topic, *steps = re.split(r"\.|(?=\[)", path)
        if topic in NOT_ALWAYS:
            assert topics.TYPES[topic] == NOT_ALWAYS[topic]
            continue
        value = messages[topic]
        if time == "headerStamp":
            assert value.header.stamp.sec > 0
        for step in steps:
            value = value[int(step[1:-1])] if step.startswith("[") else getattr(value, step)
        assert isinstance(value, float if panel.startswith("Plot") else str), path


def test_positions_and_offsets_are_those_of_the_dof_in_the_title(messages: dict[str, Any]) -> None:
    names = messages[topics.REFERENCE].name
    labels = messages[topics.DELTA].layout.dim[0].label.split(",")
    for panel, path, _ in series():
        if panel.startswith("Plot"):
            index = int(path[path.rindex("[") + 1 : -1])
            owner = labels[index // 2] if "delta" in path else names[index]
            assert f", {owner} [" in PANELS[panel]["foxglovePanelTitle"]


def test_panels_of_one_topic_show_its_type() -> None:
    image = PANELS["Image!image"]["imageMode"]
    found = {key: topics.TYPES[topic] for key, topic in image.items()}
    for panel, config in PANELS.items():
        if "topicToRender" in config:
            found[panel.partition("!")[0]] = topics.TYPES[config["topicToRender"]]
    assert found == SHOWN
