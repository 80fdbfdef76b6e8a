"""Stress tests with arbitrary CAN frames."""

import struct
from contextlib import suppress

from bus_transcript import frame, open_transcript
from drive_settings import drives_config
from hypothesis import given, settings
from hypothesis import strategies as st
from tautscope.bench.drive import SimulatedDrive
from tautscope.dof import Dof
from tautscope.errors import DriveError
from tautscope.hardware import object_dictionary as objects

frames = st.tuples(st.integers(0, 0x7FF), st.binary(max_size=8))
requests = st.tuples(  # SDO requests
    st.just(0x602),
    st.builds(
        lambda command, entry, value: struct.pack("<BHBI", command, *entry, value),
        st.sampled_from([0x40, 0x23, 0x2B, 0x2F, 0x80, 0x60]),
        st.sampled_from([(entry.index, entry.subindex) for entry in objects.device_profile(2)]),
        st.integers(0, 2**32 - 1) | st.integers(0, 255),
    ),
)


def test_malformed_frames_crash_neither_master_nor_drive() -> None:
    """The drive answers or ignores a frame; the master raises only `DriveError`."""
    drive = SimulatedDrive(
        Dof.ROTATION,
        drives_config(),
        lambda identifier, data: None,
        lambda now, what: None,
        modes=frozenset({7, 8}),
    )

    @settings(deadline=None)
    @given(st.lists(frames | requests | st.just((0x080, b"")), max_size=40))
    def check(received: list[tuple[int, bytes]]) -> None:
        drive.boot(0.0)
        drive.receive(0x000, bytes.fromhex("0102"), 0.0)
        for number, (identifier, data) in enumerate(received):
            drive.receive(identifier, data, number * 0.01)
            drive.tick(number * 0.01)
        fieldbus.start()
        bus.waiting += [frame(identifier, data) for identifier, data in received]
        with suppress(DriveError):
            fieldbus.exchange([0] * 3, [0] * 3)

    with open_transcript({}) as (fieldbus, bus):
        check()
