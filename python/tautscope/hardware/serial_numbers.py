"""Serial numbers of the camera and the drives of a rig."""

from contextlib import closing
from pathlib import Path

from tautscope.config import CameraConfig, Config
from tautscope.errors import ConfigError
from tautscope.hardware.drives import open_group
from tautscope.hardware.rig_lock import RigLock

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


def read_serial_numbers(config: Config) -> dict[str, str]:
    """The serial numbers of camera and drives of a configuration, where they have one.

    Raises:
        ConfigError: The section ``drives`` is missing.
        DriveError: A drive does not answer, or another program commands them.
    """
    if config.drives is None:
        raise ConfigError("drives", None, "a section [drives] that names the motors")
    with RigLock(config.drives), closing(open_group(config.drives)) as group:
        drives = {
            motor.label: number
            for motor in config.drives.all_motors
            if (number := group.serial_number(motor))
        }
    return camera_serial_number(config.camera) | drives
