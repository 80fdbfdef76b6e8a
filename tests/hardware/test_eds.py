"""What a maker's EDS file says of a drive counts, if it is of that drive."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from drive_rig import AXES, drives_config
from tautscope.bench.can_bus import Hub
from tautscope.dof import Dof
from tautscope.errors import ConfigError, SettingRefusedError
from tautscope.hardware import object_dictionary as objects
from tautscope.hardware.canopen_drives import CanopenLink
from tautscope.hardware.drives import open_drives
from transcript import QUICK, Transcript

EDS = """[FileInfo]
FileName=drive.eds
[DeviceInfo]
VendorNumber={vendor}
[607F]
ParameterName=Max profile velocity
ObjectType=0x7
DataType=0x0006
AccessType=rw
[6060]
ParameterName=Modes of operation
ObjectType=0x7
DataType=0x0002
AccessType=rw
"""


def test_the_eds_file_says_how_long_an_object_is(tmp_path: Path) -> None:
    """Festo: 2B is a download of two bytes. Type 0x0006 is UNSIGNED16, as some drives have it."""
    file = tmp_path / "drive.eds"
    file.write_text(EDS.format(vendor=0), encoding="utf-8")
    sent = "601#2B7F6000E8030000"
    bus = Transcript(lambda frame: ["581#607F600000000000"] if frame == sent else [])
    axis = AXES["insertion"] | {"eds": str(file)}
    link = CanopenLink(drives_config(**QUICK, insertion=axis), bus)
    try:
        link.write(Dof.INSERTION, objects.PROFILE_SPEED_LIMIT, 0x03E8)
        assert bus.sent == [sent]
        with pytest.raises(SettingRefusedError, match=r"cannot hold 65536.*EDS"):
            link.write(Dof.INSERTION, objects.PROFILE_SPEED_LIMIT, 65536)
    finally:
        link.close()


def test_the_eds_file_of_another_drive_is_refused(
    tmp_path: Path, hub: Hub, bench: Callable[..., object]
) -> None:
    file = tmp_path / "drive.eds"
    file.write_text(EDS.format(vendor="0x9A"), encoding="utf-8")
    axis = AXES["insertion"] | {"eds": str(file)}
    config = drives_config(channel=str(hub.path), insertion=axis)
    bench(config)
    with pytest.raises(ConfigError, match=r"Vendor id\) is 0x0, not 0x9A") as found:
        open_drives(config)
    assert found.value.field == "drives.insertion.eds"
