"""Object dictionary entries of CiA 301 and CiA 402 that this package uses.

The table replaces the EDS file of a drive where the configuration names none.
"""

from dataclasses import dataclass
from typing import Literal

Access = Literal["ro", "rw", "const"]

SIGNED = {1: 0x02, 2: 0x03, 4: 0x04}
"""CiA 301 data type by length in bytes: INTEGER8, INTEGER16, INTEGER32."""
UNSIGNED = {1: 0x05, 2: 0x06, 4: 0x07}
"""CiA 301 data type by length in bytes: UNSIGNED8, UNSIGNED16, UNSIGNED32."""
SIZES = {number: size for types in (SIGNED, UNSIGNED) for size, number in types.items()}
"""Length in bytes by CiA 301 data type."""


@dataclass(frozen=True, slots=True)
class Entry:
    """One value of a drive's object dictionary.

    Attributes:
        index, subindex: Its address.
        name: Its name in the standard.
        size: Length [byte].
        signed: Whether the integer is signed.
        access: ``rw``, ``ro`` or ``const``.
        default: Its value after power-on.
        mappable: Whether a PDO can carry it.
    """

    index: int
    subindex: int
    name: str
    size: Literal[1, 2, 4]
    signed: bool = False
    access: Access = "rw"
    default: int = 0
    mappable: bool = False

    def __str__(self) -> str:
        return f"0x{self.index:04X}:{self.subindex} ({self.name})"

    @property
    def data_type(self) -> int:
        """Number of the data type in CiA 301."""
        return (SIGNED if self.signed else UNSIGNED)[self.size]

    @property
    def mapping(self) -> int:
        """The PDO mapping entry: index, sub-index, length in bits."""
        return self.index << 16 | self.subindex << 8 | self.size * 8

    def encode(self, value: int) -> bytes:
        """Encode a value as little-endian bytes.

        Raises:
            OverflowError: The value does not fit.
        """
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


def pdo_entries(base: int, mapping: int, cob: int, name: str) -> tuple[Entry, ...]:
    """Communication and mapping parameters of one PDO with four mapped objects."""
    return (
        Entry(base, 1, f"{name} COB-ID", 4, default=cob),
        Entry(base, 2, f"{name} transmission type", 1, default=255),
        Entry(mapping, 0, f"{name} number of mapped objects", 1),
        *(Entry(mapping, sub, f"{name} mapped object {sub}", 4) for sub in range(1, 5)),
    )


def device_profile(node: int) -> tuple[Entry, ...]:
    """Every object of a drive with a node id."""
    pdos = [
        (kind, number, base + number, base + 0x200 + number, cob + number * 0x100 + node)
        for kind, base, cob in (("Receive PDO", 0x1400, 0x200), ("Transmit PDO", 0x1800, 0x180))
        for number in range(2)
    ]
    single = tuple(value for value in globals().values() if isinstance(value, Entry))
    return single + tuple(
        entry
        for kind, number, base, mapping, cob in pdos
        for entry in pdo_entries(base, mapping, cob, f"{kind} {number + 1}")
    )
