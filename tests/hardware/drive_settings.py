"""Settings of three drives for tests; long timeouts, for a busy computer."""

from typing import Any

from tautscope.config import DrivesConfig, from_document

EXPERIMENT = {
    "rotation": {"centre": 0.0, "amplitude": 1.5},
    "bending": {"centre": 0.9, "amplitude": 0.3},
}
"""Within the travel of `AXES`, with the slack."""
AXES = {
    "insertion": {
        "node": 1,
        "counts_per_unit": 1e6,
        "sign": 1,
        "travel": [-0.05, 0.06],
        "speed_limit": 0.15,
        "following_error": 0.004,
        "following_window": 0.002,
    },
    "rotation": {
        "node": 2,
        "counts_per_unit": 10_000.0,
        "sign": -1,
        "travel": [-3.0, 3.5],
        "speed_limit": 20.0,
        "following_error": 0.3,
        "following_window": 0.15,
        "home": 0.25,
    },
    "bending": {
        "node": 3,
        "counts_per_unit": 10_000.0,
        "sign": 1,
        "travel": [-2.5, 2.0],
        "speed_limit": 10.0,
        "following_error": 0.2,
        "following_window": 0.1,
    },
}

TIMES = {
    "interface": "tautscope",
    "heartbeat_period": 0.1,
    "heartbeat_timeout": 3.0,
    "state_timeout": 4.0,
    "request_timeout": 5.0,
    "cycle": 0.02,
    "reply_timeout": 0.019,
}


def drives_document(**changes: Any) -> dict[str, Any]:
    return {**{dof: dict(axis) for dof, axis in AXES.items()}, **TIMES, **changes}


def drives_config(**changes: Any) -> DrivesConfig:
    config = from_document({"drives": drives_document(**changes)}).drives
    assert config is not None
    return config
