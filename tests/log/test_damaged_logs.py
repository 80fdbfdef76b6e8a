"""Truncated and damaged logs, and files that are not logs."""

import shutil
from pathlib import Path

import numpy as np
import pytest
from mcap.writer import MCAP0_MAGIC, Writer
from rosbags.highlevel import AnyReader
from tautscope.cli import main
from tautscope.errors import MissingPathError, OutputError, RecordError
from tautscope.log.export import export_rosbag, recover
from tautscope.log.mcap_records import Damage
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


def test_an_index_whose_opcode_became_that_of_a_message_is_no_message(
    recorded: Recorded, tmp_path: Path
) -> None:
    path, _, _ = recorded
    data, at = bytearray(path.read_bytes()), 8
    damaged = tmp_path / "damaged.mcap"
    while data[at] != 0x0F:  # data end
        if data[at] == 0x07:
            data[at] = 0x05
        at += 9 + int.from_bytes(data[at + 1 : at + 9], "little")
    damaged.write_bytes(data)
    assert list(read_log(damaged).events) == list(read_log(path).events)


def mcap(path: Path, topics: list[str]) -> Path:
    """A complete log of another program, with a message of each topic."""
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start("ros2", "another program")
        schema = writer.register_schema("std_msgs/msg/String", "ros2msg", b"string data")
        for time, topic in enumerate(topics):
            channel = writer.register_channel(topic, "cdr", schema)
            writer.add_message(channel, time, b"\0\1\0\0\2\0\0\0a\0", time)
        writer.finish()
    return path


@pytest.mark.parametrize(
    ("topics", "found"),
    [
        ([], "no messages"),
        (["/PSM1/measured_js", "/tf"], "/PSM1/measured_js, /tf"),
        (["/instrument/measured_js", "/tf"], "/instrument/measured_js, /tf"),  # CRTK is not ours
    ],
)
def test_nothing_is_written_of_a_foreign_log(tmp_path: Path, topics: list[str], found: str) -> None:
    file, out = mcap(tmp_path / "foreign.mcap", topics), tmp_path / "out.mcap"
    for repair in (lambda: recover(file, out), lambda: export_rosbag(file, tmp_path / "bag")):
        with pytest.raises(RecordError, match=f"{found}', expected a log of tautscope, with"):
            repair()
    assert list(tmp_path.iterdir()) == [file]


def test_what_is_missing_is_said_in_words(recorded: Recorded, tmp_path: Path) -> None:
    complete = recorded[0].read_bytes()
    file = tmp_path / "cut.mcap"
    sizes: set[bool] = set()
    for cut in (len(complete) - 1, len(complete) - len(MCAP0_MAGIC), len(complete) - 37):
        file.write_bytes(complete[:cut])
        damage = read_log(file).damage
        sizes.add(damage.lost_bytes > 0)
        expected = f"its last {damage.lost_bytes} bytes are" if damage.lost_bytes else "no end"
        assert expected in str(damage)
        assert " 0 bytes" not in str(damage)
    assert sizes == {True, False}
    assert str(Damage(is_truncated=False, bad_chunks=2)) == "2 damaged chunks were skipped"
    assert str(Damage(is_truncated=False)) == ""


def test_files_that_are_not_logs_are_rejected(tmp_path: Path, recorded: Recorded) -> None:
    with pytest.raises(MissingPathError, match=r"none\.mcap.*an MCAP file"):
        read_log(tmp_path / "none.mcap")
    (tmp_path / "text.mcap").write_text("no magic at all")
    with pytest.raises(RecordError, match=r"text\.mcap.*an MCAP file"):
        read_log(tmp_path / "text.mcap")
    (tmp_path / "head.mcap").write_bytes(recorded[0].read_bytes()[:40])
    with pytest.raises(RecordError, match=r"head\.mcap: no messages at the start.*a log of"):
        read_log(tmp_path / "head.mcap")
    with pytest.raises(OutputError, match="does not exist yet"):
        recover(recorded[0], recorded[0])
    assert sorted(path.name for path in tmp_path.iterdir()) == ["head.mcap", "text.mcap"]


def test_a_folder_in_place_of_a_log_is_answered_with_its_log(
    tmp_path: Path, recorded: Recorded, capsys: pytest.CaptureFixture[str]
) -> None:
    log = Path(shutil.copy(recorded[0], tmp_path / "run.mcap"))
    for verb, *option in (["replay"], ["recover"], ["export", "--csv"], ["export", "--rosbag=b"]):
        assert main([verb, str(tmp_path), *option]) == 2
        assert f"an MCAP file, such as {log}" in capsys.readouterr().err
