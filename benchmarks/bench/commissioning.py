"""What a user does with a new rig before its first run, on the bench."""

import json
import math
import re
import tempfile
import time
import tomllib
from pathlib import Path
from typing import Any

from bench.processes import Rig, call, start_rig
from common.paths import ROOT
from tautscope.config import Config, dump_config, from_document

PAGE = ROOT / "docs" / "hardware.md"
DRAWN = 0
"""Seed of the rig that differs from its configuration."""


def check(file: Path) -> list[str]:
    """What `doctor` misses."""
    found = call("doctor", "--config", file, statuses=(0, 1))
    return [one["what"] for one in found["findings"] if one["status"] == "missing"]


def calibrate(file: Path, config: Config) -> dict[str, Any]:
    """Find the stops of insertion, of a servo, and the geometry; both are written into the file."""
    assert config.drives is not None
    document: dict[str, Any] = {}
    to_file = ("--config", file, "--yes", "--write")
    if stops := config.drives.insertion.stops:
        file.write_text(dump_config(config.replace(**{"drives.insertion.stops": None})), "utf-8")
        found = call("calibrate", "stops", "insertion", *to_file)["stops"]
        document["stops"] = [{"true": a, "found": b} for a, b in zip(stops, found, strict=True)]
    found = call("calibrate", "geometry", *to_file)
    document["geometry"] = {key: found[key] for key in ("residual", "std") if key in found}
    return document


def owners(only: str | None, heartbeat_timeout: float | None) -> list[dict[str, Any]]:
    """From the configuration of each owner in docs/hardware.md to a first compensated motion."""
    changes = {} if heartbeat_timeout is None else {"heartbeat_timeout": heartbeat_timeout}
    blocks = re.findall(r"```toml\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    return [_owner(tomllib.loads(block), changes) for block in blocks if (only or "") in block]


def _owner(document: dict[str, Any], changes: dict[str, float]) -> dict[str, Any]:
    """Check, calibrate and move a rig that differs from its configuration."""
    drives = document["drives"]
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        drives |= changes | {"channel": str(folder / "bus")}
        if "preset" in drives:
            drives["interface"] = "tautscope"
        source = {"url": f"unix:{folder / 'video'}", "format": "nut", "clock": "device"}
        document["camera"]["source"] = source
        with start_rig(from_document(document), folder, "--drawn", str(DRAWN)) as rig:
            return {"drives": drives.get("protocol", drives.get("preset"))} | _path(rig, folder)


def _path(rig: Rig, folder: Path) -> dict[str, Any]:
    file, out, began = folder / "rig.toml", folder / "calibration", time.monotonic()
    try:
        missing = check(file)
        moved = call("jog", "insertion", "0.001", "--config", file, "--yes")["moved"]
        rig.request("board camera")
        call("calibrate", "camera", "--config", file, "--write")
        rig.request("clear camera")
        done = call(
            *("calibrate", "all", "--config", file, "--yes", "--skip", "camera", "--out", out)
        )["done"]
        motion = json.loads((out / "motion.json").read_text(encoding="utf-8"))["notes"]
        said = ""
    except RuntimeError as error:
        missing, moved, done, motion, said = [], math.nan, [], [], str(error)
    return {
        "missing": missing,
        "moved": moved,
        "done": done,
        "motion": motion,
        "said": said,
        "minutes": (time.monotonic() - began) / 60,
    }
