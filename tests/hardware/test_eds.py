"""EDS files of manufacturers."""

import re
from collections.abc import Callable
from contextlib import closing
from io import StringIO
from pathlib import Path

import canopen
import pytest
from bus_transcript import QUICK, Transcript
from canopen.objectdictionary import ODRecord, ODVariable, export_od, import_od
from drive_settings import AXES, drives_config
from tautscope.bench.can_bus import Hub
from tautscope.dof import Dof
from tautscope.errors import ConfigError, SettingRefusedError
from tautscope.hardware import object_dictionary as objects
from tautscope.hardware.canopen_fieldbus import CanopenFieldbus
from tautscope.hardware.drives import open_drives
from tautscope.hardware.eds import load_eds

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


NODE = 5


@pytest.fixture(scope="module")
def text() -> str:
    """An EDS file of a CiA 402 drive, written by the `canopen` library."""
    dictionary = canopen.ObjectDictionary()
    dictionary.device_information.vendor_number = 0x9A
    dictionary.device_information.product_number = 1
    for entry in objects.device_profile(NODE):
        record = dictionary.get(entry.index) or ODRecord(entry.name, entry.index)
        dictionary.add_object(record)
        variable = ODVariable(entry.name, entry.index, entry.subindex)
        variable.data_type, variable.access_type = entry.data_type, entry.access
        record.add_member(variable)
    stream = StringIO()
    export_od(dictionary, stream, "eds")
    return stream.getvalue()


def test_types_are_those_that_the_canopen_library_reads(tmp_path: Path, text: str) -> None:
    file = tmp_path / "drive.eds"
    file.write_text(text, encoding="utf-8")
    expected, found = import_od(str(file), NODE), load_eds(str(file), NODE)
    keys = [(entry.index, entry.subindex) for entry in objects.device_profile(NODE)]
    assert found.types == {key: expected.get_variable(*key).data_type for key in keys}
    assert found.vendor == expected.device_information.vendor_number
    assert load_eds(None, NODE).types == found.types


def insert(line: str, section: str) -> Callable[[str], str]:
    """Insert a line at the end of a section."""
    return lambda text: re.sub(rf"(?s)(\[{section}\].*?)(\n\[|$)", rf"\1{line}\n\2", text, count=1)


DAMAGES: dict[str, Callable[[str], str | bytes]] = {
    "cp1252": lambda text: ("; Antrieb f\xfcr gr\xf6\xdfere \x80\n" + text).encode("latin-1"),
    "byte order mark": lambda text: (
        "[DeviceInfo]\nVendorNumber=0x9A\n" + text.replace("[DeviceInfo]", "[Other]")
    ).encode("utf-8-sig"),
    "UTF-16": lambda text: text.encode("utf-16"),
    "CRLF": lambda text: text.replace("\n", "\r\n"),
    "blank PDOMapping": lambda text: re.sub("PDOMapping=.*", "PDOMapping=", text),
    "other case": str.upper,
    "lower case": str.lower,
    "no ParameterName": lambda text: re.sub("ParameterName=.*\n", "", text),
    "no AccessType": lambda text: re.sub("AccessType=.*\n", "", text),
    "orphan": lambda text: text + "[5FFFsub1]\nDataType=7\n[OptionalObjects]\n99=0x5FFE\n",
    "double section": lambda text: text + "[6060]\nDataType=0x0007\n[6060sub0]\nDataType=7\n",
    "double key": insert("DataType=0x0007", "6064sub0"),
    "node id": insert("DefaultValue=$NODEID + 0x180", "6060sub0"),
    "not a number": insert("LowLimit=none", "6060sub0"),
    "line without =": lambda text: text.replace("[6060", "end of object\n\n[6060"),
    "text before the first section": lambda text: "EDS of our drive\n" + text,
    "octal": lambda text: text.replace("DataType=0x000", "DataType=0"),
    "leading zero in a sub-index": lambda text: re.sub(r"sub(\w)\]", r"Sub0\1]", text),
    "indented": lambda text: text.replace("\n", "\n  "),
    "spaces and comments": lambda text: re.sub("DataType=(.*)", r"DataType = \1 ; type", text),
    "unused object with a type of its own": lambda text: text + "[2001]\nDataType=0xA0\n",
    "compact sub-objects": lambda text: (
        re.sub(r"(?s)\[607Dsub\w\].*?\n(?=\[)", "", text)
        + "[607D]\nCompactSubObj=2\nDataType=0x0004\n"
    ),
}


@pytest.mark.parametrize("damage", DAMAGES)
def test_what_is_not_used_does_not_matter(tmp_path: Path, text: str, damage: str) -> None:
    """As in files of makers: canopen issues 1, 313; CANopen-monitor 27, 86, 87; canopen-rpi 7."""
    damaged = DAMAGES[damage](text)
    assert damaged != text
    file = tmp_path / "drive.eds"
    file.write_bytes(damaged if isinstance(damaged, bytes) else damaged.encode())
    found = load_eds(str(file), NODE)
    assert found.types == load_eds(None, NODE).types
    assert found.vendor == 0x9A


@pytest.mark.parametrize(
    ("pattern", "instead", "message"),
    [
        (r"(\[607Fsub0\].*?DataType)=\w+", r"\1=0x0008", r"607F:0 .*not an integer.*0x0008"),
        (r"(\[607Fsub0\].*?DataType)=\w+", r"\1=U32", r"\[607fsub0\] datatype: got 'u32'"),
        (r"VendorNumber=\w+", "VendorNumber=9A h", r"\[deviceinfo\] vendornumber: got '9a h'"),
    ],
)
def test_unusable_entry_is_named(
    tmp_path: Path, text: str, pattern: str, instead: str, message: str
) -> None:
    file = tmp_path / "drive.eds"
    damaged = re.sub(f"(?s){pattern}", instead, text, count=1)
    file.write_text(damaged, encoding="utf-8")
    with pytest.raises(ValueError, match=message):
        load_eds(str(file), NODE)


@pytest.mark.parametrize(("number", "vendor"), [("001", 1), ("010", 8), ("0x0A", 10), ("", None)])
def test_numbers_of_cia_306(tmp_path: Path, text: str, number: str, vendor: int | None) -> None:
    """Octal numbers begin with 0."""
    file = tmp_path / "drive.eds"
    damaged = re.sub("VendorNumber=.*", f"VendorNumber={number}", text)
    file.write_text(damaged, encoding="utf-8")
    assert load_eds(str(file), NODE).vendor == vendor
