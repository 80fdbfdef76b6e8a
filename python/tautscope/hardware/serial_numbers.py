"""Serial numbers of the camera and the drives of a rig."""

from __future__ import annotations

from pathlib import Path

from tautscope.config import CameraConfig, Config
from tautscope.dof import Dof
from tautscope.errors import ConfigError
from tautscope.hardware import object_dictionary as objects
from tautscope.hardware.drives import open_fieldbus
from tautscope.hardware.fieldbus import AbsentError, Fieldbus

CAMERA = "camera"


def camera_serial_number(config: CameraConfig) -> dict[str, str]:
    """The USB serial number of a V4L2 device, by the name ``camera``; empty if it has none."""
    name = Path(config.source.url).resolve().name
    device = Path("/sys/class/video4linux") / name / "device"
    for folder in (device / "..", device):
        try:
            serial = (folder / "serial").read_text(encoding="ascii").strip()
        except (OSError, UnicodeDecodeError):
            continue
        if serial:
            return {CAMERA: serial}
    return {}


def drive_serial_numbers(fieldbus: Fieldbus) -> dict[str, str]:
    """The serial numbers of the drives (0x1018:4) that have one, by the name of the DOF.

    Raises:
        DriveError: A drive does not answer.
    """
    found = {}
    for dof in Dof:
        try:
            number = fieldbus.read(dof, objects.SERIAL_NUMBER)
        except AbsentError:
            continue
        if number:
            found[dof.label] = f"{number:08X}"
    return found


def read_serial_numbers(config: Config) -> dict[str, str]:
    """The serial numbers of camera and drives of a configuration, where they have one.

    Raises:
        ConfigError: The section ``drives`` is missing.
        DriveError: A drive does not answer.
    """
    if config.drives is None:
        raise ConfigError("drives", None, "a section [drives] that names the motors")
    fieldbus = open_fieldbus(config.drives)
    try:
        drives = drive_serial_numbers(fieldbus)
    finally:
        fieldbus.close()
    return camera_serial_number(config.camera) | drives
