"""What a torn or spoilt log still says, and what is no log."""

from pathlib import Path

import numpy as np
import pytest
from rosbags.highlevel import AnyReader
from tautscope.errors import MissingPathError, OutputError, RecordError
from tautscope.log.export import recover
from tautscope.log.reader import Tick, read_log
from tautscope.log.writer import LogSummary
from tautscope.recording import Recording, per_dof

Recorded = tuple[Path, Recording, LogSummary]


def test_a_truncated_log_is_read_up_to_its_end(recorded: Recorded, tmp_path: Path) -> None:
    path, recording, _ = recorded
    whole = path.read_bytes()
    rng = np.random.default_rng(0)
    torn = tmp_path / "torn.mcap"
    before = -1
    for cut in sorted(rng.integers(20_000, len(whole), 12)):
        torn.write_bytes(whole[:cut])
        log = read_log(torn)
        assert log.damage.is_torn
        ticks = [event for event in log.events.values() if isinstance(event, Tick)]
        assert len(ticks) >= before, cut
        before = len(ticks)
        np.testing.assert_array_equal(
            [tick.command for tick in ticks], per_dof(recording.trace, "command")[: len(ticks)]
        )
        mended = tmp_path / f"{cut}.mcap"
        found = recover(torn, mended)
        assert found.damage.is_torn
        with AnyReader([mended]) as reader:
            assert sum(1 for _ in reader.messages()) == sum(found.messages.values())
        assert list(read_log(mended).events) == list(log.events)
        assert not read_log(mended).damage
    assert before > 0.9 * len(recording.trace)


def test_a_flipped_bit_costs_at_most_its_chunk(recorded: Recorded, tmp_path: Path) -> None:
    path, recording, _ = recorded
    whole = path.read_bytes()
    rng = np.random.default_rng(1)
    spoilt = tmp_path / "spoilt.mcap"
    for at in rng.integers(50_000, len(whole), 20):
        data = bytearray(whole)
        data[at] ^= 1 << int(rng.integers(8))
        spoilt.write_bytes(data)
        log = read_log(spoilt)
        known = {tick.sample.time: tick for tick in log.events.values() if isinstance(tick, Tick)}
        rows = np.isin(recording.trace["time"], list(known))
        np.testing.assert_array_equal(
            [tick.command for tick in known.values()], per_dof(recording.trace, "command")[rows], at
        )


def test_files_that_are_not_logs_are_rejected(tmp_path: Path, recorded: Recorded) -> None:
    with pytest.raises(MissingPathError, match=r"none\.mcap.*an MCAP file"):
        read_log(tmp_path / "none.mcap")
    (tmp_path / "text.mcap").write_text("no magic at all")
    with pytest.raises(RecordError, match=r"text\.mcap.*an MCAP file"):
        read_log(tmp_path / "text.mcap")
    (tmp_path / "head.mcap").write_bytes(recorded[0].read_bytes()[:40])
    with pytest.raises(RecordError, match="a log of tautscope"):
        read_log(tmp_path / "head.mcap")
    with pytest.raises(OutputError, match="does not exist yet"):
        recover(recorded[0], recorded[0])
    assert sorted(path.name for path in tmp_path.iterdir()) == ["head.mcap", "text.mcap"]
