"""EDS files of manufacturers."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import pytest
from bus_transcript import QUICK, Transcript
from drive_settings import AXES, drives_config
from tautscope.bench.can_bus import Hub
from tautscope.dof import Dof
from tautscope.errors import ConfigError, SettingRefusedError
from tautscope.hardware import object_dictionary as objects
from tautscope.hardware.canopen_fieldbus import CanopenFieldbus
from tautscope.hardware.drives import open_drives

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


def test_eds_file_determines_object_lengths(tmp_path: Path) -> None:
    """Festo: 2B is a download of two bytes. Type 0x0006, UNSIGNED16, is used by some drives."""
    file = tmp_path / "drive.eds"
    file.write_text(EDS.format(vendor=0), encoding="utf-8")
    sent = "601#2B7F6000E8030000"
    bus = Transcript(lambda frame: ["581#607F600000000000"] if frame == sent else [])
    axis = AXES["insertion"] | {"eds": str(file)}
    with closing(CanopenFieldbus(drives_config(**QUICK, insertion=axis), bus)) as fieldbus:
        fieldbus.write(Dof.INSERTION, objects.MAX_PROFILE_VELOCITY, 0x03E8)
        assert bus.sent == [sent]
        with pytest.raises(SettingRefusedError, match=r"cannot hold 65536.*EDS"):
            fieldbus.write(Dof.INSERTION, objects.MAX_PROFILE_VELOCITY, 65536)


def test_eds_file_of_another_drive_is_refused(
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
