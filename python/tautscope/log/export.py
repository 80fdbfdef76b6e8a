"""A log for other hands: a torn one mended, CSV, a rosbag2 folder."""

from __future__ import annotations

from dataclasses import dataclass
from os import PathLike
from pathlib import Path

from tautscope.errors import OutputError
from tautscope.log import messages as msg
from tautscope.log.mcap_file import McapFile
from tautscope.log.reader import Damage, messages_in, read_log
from tautscope.runs.output_folder import new_folder


@dataclass(frozen=True, slots=True)
class Recovery:
    """What was saved.

    Attributes:
        path: The new file, whole.
        messages: Topic -> number.
        first: Earliest log time [ns since 1970]; 0 without messages.
        last: Latest.
        damage: Of the old file.
    """

    path: Path
    messages: dict[str, int]
    first: int
    last: int
    damage: Damage


def recover(path: str | PathLike[str], out: str | PathLike[str]) -> Recovery:
    """Copy every message that can be read into a new, whole file; the old one is left as it is.

    Raises:
        MissingPathError: There is no such file.
        RecordError: It is not MCAP.
        OutputError: `out` is there already, or cannot be written.
    """
    source, target = Path(path), Path(out)
    damage = Damage()
    first = last = 0
    partial = target.with_name(f".{target.name}.partial")
    if target.exists():
        raise OutputError("out", str(target), "a file that does not exist yet")
    messages = messages_in(source, damage)
    try:
        with partial.open("wb") as file:
            whole = McapFile(file)
            for _, topic, message in messages:
                if topic not in whole:
                    continue
                at = message.log_time
                whole.add(topic, message.data, message.sequence, at, message.publish_time)
                first, last = min(first or at, at), max(last, at)
            whole.finish()
        partial.rename(target)
    except OSError as error:
        raise OutputError("out", str(target), f"a place that can be written ({error})") from None
    finally:
        partial.unlink(missing_ok=True)
    return Recovery(target, dict(whole.counts), first, last, damage)


def export_csv(path: str | PathLike[str], folder: str | PathLike[str]) -> Damage:
    """Make the folder of CSV and TOML that `Recording.save` makes.

    Returns:
        What of the log could not be read.

    Raises:
        MissingPathError, RecordError, ConfigError: As `read_log`.
        OutputError: The folder holds something already, or cannot be written.
    """
    log = read_log(path)
    log.recording().save(folder)
    return log.damage


def export_rosbag(path: str | PathLike[str], folder: str | PathLike[str]) -> Recovery:
    """Make a rosbag2 folder: the messages as MCAP, and metadata.yaml (version 5).

    Raises:
        MissingPathError, RecordError: As `recover`.
        OutputError: The folder holds something already, or cannot be written.
    """
    name = f"{Path(folder).name}_0.mcap"
    with new_folder(folder) as place:
        found = recover(path, place / name)
        (place / "metadata.yaml").write_text(_metadata(found, name), encoding="utf-8")
    return found


def _metadata(found: Recovery, name: str) -> str:
    topics = "".join(
        f"""\
    - topic_metadata:
        name: {topic}
        type: {kind}
        serialization_format: cdr
        offered_qos_profiles: ""
      message_count: {found.messages.get(topic, 0)}
"""
        for topic, kind in msg.TOPICS.items()
    )
    count, length = sum(found.messages.values()), found.last - found.first
    span = f"""\
duration:
    nanoseconds: {length}
  starting_time:
    nanoseconds_since_epoch: {found.first}
  message_count: {count}"""
    return f"""\
rosbag2_bagfile_information:
  version: 5
  storage_identifier: mcap
  {span}
  topics_with_message_count:
{topics}\
  compression_format: ""
  compression_mode: ""
  relative_file_paths:
    - "{name}"
  files:
    - path: "{name}"
      starting_time:
        nanoseconds_since_epoch: {found.first}
      duration:
        nanoseconds: {length}
      message_count: {count}
"""
