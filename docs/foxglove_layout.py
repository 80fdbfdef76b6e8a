"""Write docs/foxglove.json, a layout of Foxglove for logs: ``uv run docs/foxglove_layout.py``.

tests/docs/test_foxglove_layout.py finds each path in a log.
"""

import json
from pathlib import Path
from typing import Any

from tautscope.dof import Dof
from tautscope.figure_style import AMBER, BLUE, GREEN, GREY, ORANGE, PURPLE, SKY
from tautscope.log import topics

LAYOUT = Path(__file__).with_name("foxglove.json")
POSITIONS = {
    "reference": (topics.REFERENCE, GREY),
    "command": (topics.COMMAND, ORANGE),
    "applied": (topics.APPLIED, AMBER),
    "estimate": (topics.ESTIMATE, SKY),
    "true": (topics.TRUTH, GREEN),
}
OFFSETS = {"delta_minus": PURPLE, "delta_plus": BLUE}


def panels() -> dict[str, dict[str, Any]]:
    """Panel -> configuration. The part of its name before the mark is the panel's type."""
    found: dict[str, dict[str, Any]] = {
        "Image!image": {
            "imageMode": {"imageTopic": topics.IMAGE, "calibrationTopic": topics.CAMERA_INFO}
        },
        "DiagnosticSummary!status": {"topicToRender": topics.STATUS, "sortByLevel": False},
        "RosOut!warnings": {"topicToRender": topics.WARNING, "minLogLevel": 1, "searchTerms": []},
        "StateTransitions!status": {
            "paths": [
                {
                    "value": f"{topics.STATUS}.status[0].message",
                    "label": "status",
                    "timestampMethod": "headerStamp",
                },
                {
                    "value": f"{topics.EVENT}.data",
                    "label": "request",
                    "timestampMethod": "receiveTime",
                },
            ],
            "isSynced": True,
        },
    }
    for dof in Dof:
        unit = dof.display_unit.replace("mm", "m")
        positions = [
            _series(f"{topic}.position[{dof.value}]", label, colour, "headerStamp")
            for label, (topic, colour) in POSITIONS.items()
        ]
        offsets = [
            _series(f"{topics.DELTA}.data[{2 * dof.value + at}]", label, colour, "receiveTime")
            for at, (label, colour) in enumerate(OFFSETS.items())
        ]
        title = f"DOF {dof.value + 1}, {dof.label} [{unit}]"
        found[f"Plot!position{dof.value}"] = _plot(title, positions)
        found[f"Plot!offset{dof.value}"] = _plot(f"{title}: contact offsets", offsets)
    return found


def _plot(title: str, paths: list[dict[str, Any]]) -> dict[str, Any]:
    options = {"isSynced": True, "showLegend": True, "legendDisplay": "floating"}
    return {"foxglovePanelTitle": title, "paths": paths, "xAxisVal": "timestamp", **options}


def _series(path: str, label: str, colour: str, time: str) -> dict[str, Any]:
    series = {"value": path, "label": label, "color": colour, "timestampMethod": time}
    return series | {"enabled": True}


def _split(direction: str, *parts: Any) -> Any:
    """Parts of equal size side by side (`row`) or one below the other (`column`)."""
    if len(parts) == 1:
        return parts[0]
    rest = _split(direction, *parts[1:])
    share = 100 / len(parts)
    return {"direction": direction, "first": parts[0], "second": rest, "splitPercentage": share}


def layout() -> str:
    """The layout file."""
    plots = [
        _split("column", *(f"Plot!{kind}{dof.value}" for dof in Dof))
        for kind in ("position", "offset")
    ]
    texts = _split("row", "DiagnosticSummary!status", "RosOut!warnings")
    left = _split("column", "Image!image", _split("column", "StateTransitions!status", texts))
    document = {
        "configById": panels(),
        "globalVariables": {},
        "userNodes": {},
        "playbackConfig": {"speed": 1},
        "layout": _split("row", left, *plots),
    }
    return json.dumps(document, indent=2) + "\n"


if __name__ == "__main__":
    LAYOUT.write_text(layout(), encoding="utf-8")
