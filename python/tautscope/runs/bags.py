"""Topics of ROS 2 bags as a table with a row for each message; with rosbags."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import chain
from operator import attrgetter
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tautscope.errors import RecordError
from tautscope.extras import require_module
from tautscope.runs.array_files import first_line

if TYPE_CHECKING:
    import polars as pl
    from rosbags.typesys.store import Typestore

TIME = "time"
"""Title of the column of the time."""
SUFFIXES = (".mcap", ".db3")
_WIDEST = 64
"""Most numbers of an array that become columns: a longer one is no set of positions."""
_OTHER_CLOCK = 60.0
"""Stamps that differ from the time of recording by more [s] are of another clock."""
_METADATA = "metadata.yaml"
_LEFT_OUT = ("header", "layout", "covariance")
_BYTES = ("uint8", "int8", "byte", "char", "octet")
_ALLOWED = "a ROS 2 bag: its folder with metadata.yaml, or one .mcap or .db3 file"

Part = tuple[str, Any, tuple[str, ...], tuple[float, ...]]
"""Prefix, header if there is one, titles, and values of one row."""


_Rows = list[tuple[int, int, tuple[float, ...]]]
"""Stamp and time of recording [ns], and values, of the rows of one topic with the same titles."""


def read_bag(path: str | PathLike[str]) -> pl.DataFrame:
    """The numbers of all topics, in the order of time, null in the rows of other topics.

    The columns are `TIME`, /TOPIC/FIELD/..., of a JointState /TOPIC/JOINT/position, of transforms
    /TOPIC/PARENT/CHILD/translation/x. The time is that of the headers; of a topic without headers,
    or with stamps of another clock, it is that of the recording. Images are left out.

    Raises:
        MissingExtraError: rosbags is not installed.
        RecordError: The bag is damaged, or no topic has numbers.
    """
    require_module("rosbags", "reading a ROS 2 bag", "ros2")
    place = Path(path)
    if place.is_dir() and not (place / _METADATA).is_file():
        raise RecordError(f"{place / _METADATA}", "no such file", _ALLOWED)
    try:
        groups, types = _read(place)
    except Exception as error:  # of any kind, for a damaged file
        raise RecordError(str(place), first_line(error), f"{_ALLOWED}, complete") from None
    if not groups:
        found = ", ".join(f"{topic} of {kind}" for topic, kind in types.items())
        allowed = (
            "one with numbers of a type that is known, such as sensor_msgs/msg/JointState, "
            "geometry_msgs/msg/PoseStamped or tf2_msgs/msg/TFMessage"
        )
        raise RecordError(f"{place}, topics", found or "none", allowed)
    return _table(groups)


def _read(path: Path) -> tuple[dict[tuple[str, ...], _Rows], dict[str, str]]:
    """Rows by prefix and titles, and the type of each topic."""
    from rosbags.highlevel import AnyReader  # noqa: PLC0415  an extra
    from rosbags.typesys import Stores, get_typestore  # noqa: PLC0415

    groups: dict[tuple[str, ...], _Rows] = {}
    with AnyReader([path], default_typestore=get_typestore(Stores.ROS2_JAZZY)) as bag:
        types = {each.topic: each.msgtype for each in bag.connections}
        kinds = {each.msgtype for each in bag.connections}  # a topic may have several
        readers = {kind: _reader(bag.typestore, kind) for kind in kinds}
        used = [each for each in bag.connections if readers[each.msgtype] is not None]
        for connection, logged, data in bag.messages(used) if used else ():
            read = readers[connection.msgtype]
            assert read is not None
            for prefix, header, titles, values in read(bag.deserialize(data, connection.msgtype)):
                stamp = 0 if header is None else header.stamp.sec * 10**9 + header.stamp.nanosec
                rows = groups.setdefault((connection.topic + prefix, *titles), [])
                rows.append((stamp, logged, values))
    return groups, types


def _table(groups: dict[tuple[str, ...], _Rows]) -> pl.DataFrame:
    import polars as pl  # noqa: PLC0415  takes 0.3 s

    frames = []
    for (prefix, *titles), rows in groups.items():
        *times, values = zip(*rows, strict=True)
        stamped, logged = (np.array(each, np.int64) for each in times)
        late = float(np.median(np.abs(stamped - logged))) / 1e9
        is_stamped = bool(np.all(stamped != 0)) and late < _OTHER_CLOCK
        columns = np.array(values, np.float64).T
        named = {f"{prefix}/{title}": each for title, each in zip(titles, columns, strict=True)}
        frames.append(pl.DataFrame({TIME: stamped if is_stamped else logged} | named))
    table = pl.concat(frames, how="diagonal").sort(TIME, maintain_order=True)
    return table.with_columns(pl.col(TIME).cast(pl.Datetime("ns")))


def _reader(types: Typestore, kind: str) -> Callable[[Any], Iterator[Part]] | None:
    """What makes rows of a message of this type; None if it has no numbers, or is not known."""
    if kind == "sensor_msgs/msg/JointState":
        return _joints
    if kind == "tf2_msgs/msg/TFMessage":
        return _transforms
    found = _paths(types, kind)
    if not found:
        return None
    has_header = any(name == "header" for name, _ in types.fielddefs[kind][1])
    scalars = tuple(path for path, is_array in found if not is_array)
    arrays = tuple(path for path, is_array in found if is_array)

    def read(message: Any) -> Iterator[Part]:
        titles = [path.replace(".", "/") for path in scalars]
        values = [attrgetter(path)(message) for path in scalars]
        for path in arrays:
            array = attrgetter(path)(message)
            if len(array) <= _WIDEST:
                titles += [f"{path.replace('.', '/')}.{k + 1}" for k in range(len(array))]
                values += list(array)
        if titles:
            yield "", message.header if has_header else None, tuple(titles), tuple(values)

    return read


def _paths(types: Typestore, kind: str) -> list[tuple[str, bool]]:
    """Paths of the numbers of a type, and whether they are arrays.

    There are none if the type is not known, or has blocks of bytes.
    """
    from rosbags.interfaces import Nodetype  # noqa: PLC0415  an extra

    if kind not in types.fielddefs:
        return []
    found: list[tuple[str, bool]] = []
    for name, (node, detail) in types.fielddefs[kind][1]:
        if name in _LEFT_OUT:
            continue
        if node == Nodetype.NAME:
            found += [(f"{name}.{path}", is_array) for path, is_array in _paths(types, str(detail))]
            continue
        is_array = node != Nodetype.BASE
        inner: Any = detail[0] if is_array else (node, detail)
        if inner[0] != Nodetype.BASE or inner[1][0] in ("string", "wstring"):
            continue
        if is_array and inner[1][0] in _BYTES:
            return []
        found.append((name, is_array))
    return found


def _joints(message: Any) -> Iterator[Part]:
    given = [each for each in ("position", "velocity", "effort") if len(getattr(message, each))]
    arrays = [getattr(message, each)[: len(message.name)] for each in given]
    titles = [
        f"{joint}/{each}"
        for each, array in zip(given, arrays, strict=True)
        for joint in message.name[: len(array)]
    ]
    if titles:
        yield "", message.header, tuple(titles), tuple(chain.from_iterable(arrays))


_PLACE = ("translation.x", "translation.y", "translation.z")
_TURN = ("rotation.x", "rotation.y", "rotation.z", "rotation.w")


def _transforms(message: Any) -> Iterator[Part]:
    titles = tuple(path.replace(".", "/") for path in _PLACE + _TURN)
    read = attrgetter(*_PLACE, *_TURN)
    for each in message.transforms:
        prefix = f"/{each.header.frame_id.strip('/')}/{each.child_frame_id.strip('/')}"
        yield prefix, each.header, titles, read(each.transform)
