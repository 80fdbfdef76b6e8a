"""Settings of three servos for tests; long timeouts, for a busy computer."""

import math
from pathlib import Path
from typing import Any

import numpy as np
from tautscope.config import DrivesConfig, from_document

MODELS = {"dynamixel": "XL330-M077", "feetech": "STS3215"}
START = np.array([0.01, -0.5, 0.5])
AXES: dict[str, dict[str, Any]] = {
    "insertion": {"node": 1, "counts_per_unit": 1e5, "travel": [-0.05, 0.08]},
    "rotation": {"node": 2, "travel": [-9.0, 9.0], "home": -math.pi},
    "bending": {"node": 3, "travel": [-3.0, 3.0], "home": 4.0, "sign": -1},
}
TIMES = {
    "heartbeat_timeout": 2.0,
    "state_timeout": 4.0,
    "request_timeout": 2.0,
    "cycle": 0.02,
    "reply_timeout": 0.019,
}


def servos_document(protocol: str, folder: Path, **changes: Any) -> dict[str, Any]:
    axes = {name: {"model": MODELS[protocol], **axis} for name, axis in AXES.items()}
    return {"protocol": protocol, "channel": str(folder / "servos"), **axes, **TIMES, **changes}


def servos_config(protocol: str, folder: Path, **changes: Any) -> DrivesConfig:
    config = from_document({"drives": servos_document(protocol, folder, **changes)}).drives
    assert config is not None
    return config
