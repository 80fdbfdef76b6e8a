"""Settings of makers' drives, by name: `DrivesConfig.preset`."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any, get_args

from tautscope.config.drives import Preset

FOLDER = Path(__file__).with_name("drive_presets")
"""A file for each preset, which says where its settings are from."""


def with_preset(drives: dict[str, Any]) -> dict[str, Any]:
    """The document of a section ``drives`` over that of its preset, if it has one.

    Its keys replace those of the preset, except that its waivers are added. What has the wrong type
    is refused later.
    """
    name = drives.get("preset")
    if name not in get_args(Preset):
        return drives
    preset = tomllib.loads((FOLDER / f"{name}.toml").read_text(encoding="utf-8"))
    own = drives.get("waive", [])
    if isinstance(own, list | tuple):
        own = list(dict.fromkeys([*preset.get("waive", []), *own]))
    return preset | drives | {"waive": own}
