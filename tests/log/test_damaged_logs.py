"""Truncated and damaged logs, and files that are not logs."""

from pathlib import Path

import numpy as np
import pytest
from rosbags.highlevel import AnyReader
from tautscope.errors import MissingPathError, OutputError, RecordError
from tautscope.log.export import recover
from tautscope.log.reader import Tick, read_log
from tautscope.log.writer import LogSummary
from tautscope.runs.recording import Recording, per_dof

Recorded = tuple[Path, Recording, LogSummary]


def test_a_truncated_log_is_read_up_to_its_end(recorded: Recorded, tmp_path: Path) -> None:
    path, recording, _ = recorded
    complete = path.read_bytes()
    rng = np.random.default_rng(0)
    truncated = tmp_path / "truncated.mcap"
    before = -1
    for cut in sorted(rng.integers(20_000, len(complete), 12)):
        truncated.write_bytes(complete[:cut])
        log = read_log(truncated)
        assert log.damage.is_truncated
        ticks = [event for event in log.events.values() if isinstance(event, Tick)]
        assert len(ticks) >= before, cut
        before = len(ticks)
        np.testing.assert_array_equal(
            [tick.command for tick in ticks], per_dof(recording.trace, "command")[: len(ticks)]
        )
        repaired = tmp_path / f"{cut}.mcap"
        found = recover(truncated, repaired)
        assert found.damage.is_truncated
        with AnyReader([repaired]) as reader:
            assert sum(1 for _ in reader.messages()) == sum(found.messages.values())
        assert list(read_log(repaired).events) == list(log.events)
        assert not read_log(repaired).damage
    assert before > 0.9 * len(recording.trace)


def test_a_flipped_bit_costs_at_most_its_chunk(recorded: Recorded, tmp_path: Path) -> None:
    path, recording, _ = recorded
    complete = path.read_bytes()
    rng = np.random.default_rng(1)
    damaged = tmp_path / "damaged.mcap"
    for at in rng.integers(50_000, len(complete), 20):
        data = bytearray(complete)
        data[at] ^= 1 << int(rng.integers(8))
        damaged.write_bytes(data)
        log = read_log(damaged)
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
