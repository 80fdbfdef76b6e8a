"""Repair of truncated logs, and export as CSV or as a rosbag2 folder."""

import json
from collections import Counter
from dataclasses import dataclass
from os import PathLike
from pathlib import Path

from tautscope.errors import RecordError
from tautscope.log import topics
from tautscope.log.mcap_file import McapFile
from tautscope.log.mcap_records import Damage, read_messages
from tautscope.log.reader import read_log
from tautscope.runs.output_folder import check_free, new_file, new_folder


@dataclass(frozen=True, slots=True)
class Recovery:
    """Result of a repair.

    Attributes:
        path: The new, complete file.
        messages: Topic -> number of messages.
        skipped: The same of the topics that no log of tautscope has; they are not copied.
        first: Earliest log time [ns since 1970]; 0 without messages.
        last: Latest log time [ns since 1970].
        damage: Damage of the old file.
    """

    path: Path
    messages: dict[str, int]
    skipped: dict[str, int]
    first: int
    last: int
    damage: Damage


def recover(path: str | PathLike[str], out: str | PathLike[str]) -> Recovery:
    """Copy the undamaged messages into a new, complete file; the old file is not changed.

    Raises:
        MissingPathError: There is no such file.
        RecordError: The file is not MCAP, or not a log of tautscope.
        OutputError: `out` exists already, or cannot be written.
    """
    source, target = Path(path), Path(out)
    damage = Damage()
    skipped: Counter[str] = Counter()
    first = last = 0
    with new_file(target) as partial, partial.open("wb") as file:
        copy = McapFile(file)
        for _, topic, message in read_messages(source, damage):
            if topic not in topics.TYPES:
                skipped[topic] += 1
                continue
            at = message.log_time
            copy.add(topic, message.data, message.sequence, at, message.publish_time)
            first, last = min(first or at, at), max(last, at)
        if topics.CONFIG not in copy.counts:  # without it nothing of the copy can be read
            found = ", ".join([*copy.counts, *skipped]) or "no messages"
            raise RecordError(
                "log", f"{source} with {found}", f"a log of tautscope, with {topics.CONFIG}"
            )
        copy.finish()
    return Recovery(target, dict(copy.counts), dict(skipped), first, last, damage)


def export_csv(path: str | PathLike[str], folder: str | PathLike[str]) -> Damage:
    """Write the CSV and TOML files of `Recording.save` into a new folder.

    Returns:
        The damage of the log.

    Raises:
        MissingPathError, RecordError, ConfigError: As `read_log`.
        OutputError: The folder is not empty, or cannot be written.
    """
    check_free(folder)
    log = read_log(path)
    log.recording().save(folder)
    return log.damage


def export_rosbag(path: str | PathLike[str], folder: str | PathLike[str]) -> Recovery:
    """Write a rosbag2 folder: the messages as MCAP, and metadata.yaml (version 5).

    Raises:
        MissingPathError, RecordError: As `recover`.
        OutputError: The folder is not empty, or cannot be written.
    """
    name = f"{Path(folder).absolute().name}_0.mcap"
    with new_folder(folder) as new:
        recovery = recover(path, new / name)
        (new / "metadata.yaml").write_text(_metadata(recovery, name), encoding="utf-8")
    return recovery


def _metadata(recovery: Recovery, name: str) -> str:
    """As JSON, which is YAML."""
    timing = {
        "duration": {"nanoseconds": recovery.last - recovery.first},
        "starting_time": {"nanoseconds_since_epoch": recovery.first},
        "message_count": sum(recovery.messages.values()),
    }
    topics_with_count = [
        {
            "topic_metadata": {
                "name": topic,
                "type": kind,
                "serialization_format": "cdr",
                "offered_qos_profiles": "",
            },
            "message_count": recovery.messages.get(topic, 0),
        }
        for topic, kind in topics.TYPES.items()
    ]
    information = {
        "version": 5,
        "storage_identifier": "mcap",
        **timing,
        "topics_with_message_count": topics_with_count,
        "compression_format": "",
        "compression_mode": "",
        "relative_file_paths": [name],
        "files": [{"path": name, **timing}],
    }
    return json.dumps({"rosbag2_bagfile_information": information}, indent=2)
