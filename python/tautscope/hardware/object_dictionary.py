"""Object dictionary entries of CiA 301 and CiA 402 that this package uses.

The table replaces the EDS file of a drive where the configuration names none.
"""

from dataclasses import dataclass
from typing import Literal

_TYPES = {(1, True): 2, (2, True): 3, (4, True): 4, (1, False): 5, (2, False): 6, (4, False): 7}
"""CiA 301 data type of an integer by its length [byte] and whether it is signed."""
SIZES = {number: size for (size, _), number in _TYPES.items()}
"""Length [byte] by CiA 301 data type."""


@dataclass(frozen=True, slots=True)
class Entry:
    """One value of a drive's object dictionary.

    Attributes:
        size: Length [byte].
        default: Its value after power-on.
        mappable: Whether a PDO can carry it.
    """

    index: int
    subindex: int
    name: str
    size: Literal[1, 2, 4]
    signed: bool = False
    access: Literal["ro", "rw", "const"] = "rw"
    default: int = 0
    mappable: bool = False

    def __str__(self) -> str:
        return f"0x{self.index:04X}:{self.subindex} ({self.name})"

    @property
    def data_type(self) -> int:
        """Number of the data type in CiA 301."""
        return _TYPES[self.size, self.signed]

    @property
    def mapping(self) -> int:
        """The PDO mapping entry: index, sub-index, length in bits."""
        return self.index << 16 | self.subindex << 8 | self.size * 8

    def encode(self, value: int) -> bytes:
        """Encode a value as little-endian bytes; `OverflowError` if it does not fit."""
        return value.to_bytes(self.size, "little", signed=self.signed)

    def decode(self, data: bytes) -> int:
        """Decode little-endian bytes of any length."""
        return int.from_bytes(data, "little", signed=self.signed)


DEVICE_TYPE = Entry(0x1000, 0, "Device type", 4, access="ro", default=0x0002_0192)
ERROR_REGISTER = Entry(0x1001, 0, "Error register", 1, access="ro")
CONSUMER_HEARTBEAT = Entry(0x1016, 1, "Consumer heartbeat time", 4)
PRODUCER_HEARTBEAT = Entry(0x1017, 0, "Producer heartbeat time", 2)
VENDOR_ID = Entry(0x1018, 1, "Vendor id", 4, access="const")
PRODUCT_CODE = Entry(0x1018, 2, "Product code", 4, access="const")
SERIAL_NUMBER = Entry(0x1018, 4, "Serial number", 4, access="const")
ABORT_CONNECTION_OPTION = Entry(
    0x6007, 0, "Abort connection option code", 2, signed=True, default=1
)
ERROR_CODE = Entry(0x603F, 0, "Error code", 2, access="ro", mappable=True)
CONTROLWORD = Entry(0x6040, 0, "Controlword", 2, mappable=True)
STATUSWORD = Entry(0x6041, 0, "Statusword", 2, access="ro", mappable=True)
QUICK_STOP_OPTION_CODE = Entry(0x605A, 0, "Quick stop option code", 2, signed=True, default=2)
MODES_OF_OPERATION = Entry(0x6060, 0, "Modes of operation", 1, signed=True, mappable=True)
MODE_DISPLAY = Entry(
    0x6061, 0, "Modes of operation display", 1, signed=True, access="ro", mappable=True
)
POSITION_ACTUAL = Entry(
    0x6064, 0, "Position actual value", 4, signed=True, access="ro", mappable=True
)
FOLLOWING_ERROR_WINDOW = Entry(0x6065, 0, "Following error window", 4, default=0xFFFF_FFFF)
FOLLOWING_ERROR_TIMEOUT = Entry(0x6066, 0, "Following error time out", 2)
TARGET_POSITION = Entry(0x607A, 0, "Target position", 4, signed=True, mappable=True)
MIN_POSITION_LIMIT = Entry(0x607D, 1, "Min position limit", 4, signed=True, default=-(2**31))
MAX_POSITION_LIMIT = Entry(0x607D, 2, "Max position limit", 4, signed=True, default=2**31 - 1)
MAX_PROFILE_VELOCITY = Entry(0x607F, 0, "Max profile velocity", 4, default=0xFFFF_FFFF)
MAX_MOTOR_SPEED = Entry(0x6080, 0, "Max motor speed", 4, default=0xFFFF_FFFF)
ENCODER_INCREMENTS = Entry(0x608F, 1, "Encoder increments", 4, default=4096)
MOTOR_REVOLUTIONS = Entry(0x608F, 2, "Motor revolutions", 4, default=1)
INTERPOLATION_SUBMODE = Entry(0x60C0, 0, "Interpolation sub mode select", 2, signed=True)
INTERPOLATION_DATA = Entry(0x60C1, 1, "Interpolation data record", 4, signed=True, mappable=True)
INTERPOLATION_TIME = Entry(0x60C2, 1, "Interpolation time units", 1, default=1)
INTERPOLATION_EXPONENT = Entry(0x60C2, 2, "Interpolation time index", 1, signed=True, default=-3)
INTERPOLATION_BUFFER_CLEAR = Entry(0x60C4, 6, "Buffer clear", 1)
SUPPORTED_MODES = Entry(0x6502, 0, "Supported drive modes", 4, access="ro", default=0xC0)


def pdo_entries(base: int, cob: int = 0) -> tuple[Entry, ...]:
    """Communication and mapping parameters of one PDO with four mapped objects."""
    mapping, name = base + 0x200, f"PDO 0x{base:04X}"
    return (
        Entry(base, 1, f"{name} COB-ID", 4, default=cob),
        Entry(base, 2, f"{name} transmission type", 1, default=255),
        Entry(mapping, 0, f"{name} number of mapped objects", 1),
        *(Entry(mapping, sub, f"{name} mapped object {sub}", 4) for sub in range(1, 5)),
    )


def device_profile(node: int) -> tuple[Entry, ...]:
    """Every object of a drive with a node id."""
    single = tuple(value for value in globals().values() if isinstance(value, Entry))
    pdos = ((0x1400, 0x200), (0x1401, 0x300), (0x1800, 0x180), (0x1801, 0x280))
    return single + tuple(entry for base, cob in pdos for entry in pdo_entries(base, cob + node))
