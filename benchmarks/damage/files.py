"""Files that `analyze` reads, written and then damaged at random."""

import gzip
import io
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import polars as pl
from records import lerobot
from records.families import slack
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore
from scipy.io import savemat

COUNT = 240
TOKENS = (
    b"nan", b"inf", b"-inf", b"1e400", b"-1e308", b"", b"0", b'"', b"'", b"-", b"--", b"1,5",
    b"9" * 40, b"2026-11-26T10:00:00,250Z", b"25:61:61", b"\xff\xfe", b"\0", b"# ", b"sep=;",
    b"[Degree]", b"(mm", b"\r", b"\n\n", b"\t", b";", b"\xc3\x28", "τ".encode(), b"true", b"None",
)  # fmt: skip
"""Texts that take the place of others."""


def signals() -> dict[str, np.ndarray]:
    """A play of width 4 under two sines."""
    time = np.arange(COUNT) * 0.05
    motor = 8 * np.sin(2 * time) + 3 * np.sin(5.3 * time)
    tip = slack(motor, -2, 2) + 0.05 * np.random.default_rng(0).normal(size=COUNT)
    return {"time": time, "motor": motor, "tip": tip}


def wild(rng: np.random.Generator) -> dict[str, np.ndarray]:
    """Columns that fit the format and are no record: constants, gaps, infinities, one row, ..."""
    columns = signals()
    for name in rng.permutation(list(columns))[: int(rng.integers(1, 3))]:
        old = columns[name]
        part = slice(*sorted(rng.integers(0, COUNT, 2).tolist()))
        for _ in range(int(rng.integers(1, 3))):
            new = old.copy()
            value = (np.nan, np.inf, 0.0, 1e308, 1e-308, -9999.0, 1e18)[rng.integers(7)]
            kind = rng.integers(8)
            if kind == 0:
                new[part] = value
            elif kind == 1:
                new[:] = value
            elif kind == 2:
                new *= value
            elif kind == 3:
                new = rng.permutation(new)
            elif kind == 4:
                new = np.round(new / 4)
            elif kind == 5:
                new[rng.random(COUNT) < 0.3] = value
            elif kind == 6:
                new = new % 3
            else:
                new = np.repeat(new[: COUNT // 8 + 1], 8)[:COUNT]
            old = new
        columns[name] = old
    count = int(rng.choice([0, 1, 2, 3, 10, COUNT, COUNT, COUNT, COUNT, COUNT]))
    return {name: each[:count] for name, each in columns.items()}


def write_seeds(folder: Path, columns: dict[str, np.ndarray]) -> list[Path]:
    """Columns time, motor and tip in each format and dialect."""
    for write in (_texts, _arrays, _sets, _bags):
        write(folder, columns)
    return sorted(folder.iterdir())


def write_like(seed: Path, folder: Path, columns: dict[str, np.ndarray]) -> Path:
    """Columns in the format of a file of `write_seeds`."""
    _of_name(seed.name)(folder, columns)
    return folder / seed.name


def _texts(folder: Path, columns: dict[str, np.ndarray]) -> None:
    frame = pl.DataFrame(columns)
    csv = frame.write_csv().encode()
    body = csv.partition(b"\n")[2]
    texts = {
        "plain.csv": csv,
        "semicolon.csv": b"sep=;\n" + csv.replace(b",", b";").replace(b".", b","),
        "preamble.txt": b"Recorder 7\n# a comment\n\n" + csv.replace(b",", b"\t"),
        "units.csv": b"time [s],motor [deg],tip [deg]\n" + body,
        "utf16.csv": csv.decode().encode("utf-16"),
        "quoted.csv": csv.replace(b"tip\n", b'"tip, measured"\n').replace(b"\n", b"\r\n"),
        "bare.csv": body,
        "packed.csv.gz": gzip.compress(csv),
        "poses.csv": _poses(frame).write_csv().encode(),
    }
    for name, data in texts.items():
        (folder / name).write_bytes(data)


def _arrays(folder: Path, columns: dict[str, np.ndarray]) -> None:
    np.savez(folder / "arrays.npz", **columns)  # type: ignore[arg-type]
    np.savez_compressed(folder / "packed.npz", both=np.stack([*columns.values()]))
    savemat(folder / "arrays.mat", {"log": columns, "rate": 20.0})
    pl.DataFrame(columns).write_parquet(folder / "plain.parquet")


def _sets(folder: Path, columns: dict[str, np.ndarray]) -> None:
    """A data set whose first episode has the columns."""
    for version in lerobot.OF_FILE:
        file = lerobot.write(folder / f"set_{version}", version, 2, COUNT)
        first = min(file.glob("data/*/*.parquet"))
        rows = pl.read_parquet(first).head(len(columns["time"]))
        rows = rows.with_columns(
            pl.Series("action", [[each] * 3 for each in columns["motor"].tolist()]),
            pl.Series("timestamp", columns["time"]),
        ).with_columns(pl.lit(0).alias("episode_index"))
        rows.write_parquet(first)


def _bags(folder: Path, columns: dict[str, np.ndarray]) -> None:
    for storage, ending in ((StoragePlugin.MCAP, "mcap"), (StoragePlugin.SQLITE3, "db3")):
        _write_bag(folder / f"bag_{ending}", storage, columns)
        shutil.copy(next((folder / f"bag_{ending}").glob(f"*.{ending}")), folder / f"one.{ending}")


def _of_name(name: str) -> Callable[[Path, dict[str, np.ndarray]], None]:
    if name.startswith("set_"):
        return _sets
    if name.endswith(("mcap", "db3")):
        return _bags
    return _arrays if name.endswith((".npz", ".mat", ".parquet")) else _texts


def _poses(frame: pl.DataFrame) -> pl.DataFrame:
    half = pl.col("tip") / 20
    zero = pl.lit(0.0)
    return frame.with_columns(
        tip_x=pl.col("tip"), tip_y=zero, tip_z=zero,
        tip_qx=half.sin(), tip_qy=zero, tip_qz=zero, tip_qw=half.cos(),
    )  # fmt: skip


def _write_bag(folder: Path, storage: StoragePlugin, columns: dict[str, np.ndarray]) -> None:
    types = get_typestore(Stores.ROS2_JAZZY)
    new = types.types
    with Writer(folder, version=9, storage_plugin=storage) as bag:
        kinds = ("sensor_msgs/msg/JointState", "geometry_msgs/msg/PointStamped")
        topics = [
            bag.add_connection(f"/topic_{k}", kind, typestore=types) for k, kind in enumerate(kinds)
        ]
        for k, (at, motor, tip) in enumerate(zip(*columns.values(), strict=True)):
            logged = 10**18 + k * 50_000_000
            stamp = logged + (int(at * 1e9) - k * 50_000_000 if 0 <= at < 1e6 else 0)
            time = new["builtin_interfaces/msg/Time"](sec=stamp // 10**9, nanosec=stamp % 10**9)
            header = new["std_msgs/msg/Header"](stamp=time, frame_id="base")
            none = np.array([])
            joints = new[kinds[0]](
                header=header, name=["m"], position=np.array([motor]), velocity=none, effort=none
            )
            point = new["geometry_msgs/msg/Point"](x=float(tip), y=0.0, z=0.0)
            messages = (joints, new[kinds[1]](header=header, point=point))
            for topic, kind, message in zip(topics[: 1 + k % 2], kinds, messages):  # noqa: B905
                bag.write(topic, logged, types.serialize_cdr(message, kind))


def damage(seed: Path, place: Path, rng: np.random.Generator) -> Path:
    """Copy a file or folder, and damage it, or one of its files."""
    target = place / seed.name
    if not seed.is_dir():
        target.write_bytes(_damaged(seed.read_bytes(), rng))
        return target
    shutil.copytree(seed, target)
    files = sorted(each for each in target.rglob("*") if each.is_file())
    victim = files[rng.integers(len(files))]
    if rng.random() < 0.1:
        victim.unlink()
    else:
        victim.write_bytes(_damaged(victim.read_bytes(), rng))
    return target


def _damaged(data: bytes, rng: np.random.Generator) -> bytes:
    if rng.random() < 0.03:
        return rng.bytes(int(rng.integers(0, 2000)))
    if rng.random() < 0.3:
        return _flip(data, rng)
    for _ in range(int(rng.integers(1, 5))):
        data = _KINDS[rng.integers(len(_KINDS))](data, rng)
    return data


def _cut(data: bytes, rng: np.random.Generator) -> bytes:
    return data[: rng.integers(len(data) + 1)]


def _flip(data: bytes, rng: np.random.Generator) -> bytes:
    changed = bytearray(data)
    for at in rng.integers(len(data), size=rng.integers(1, 9)) if data else ():
        changed[at] = rng.integers(256)
    return bytes(changed)


def _block(data: bytes, rng: np.random.Generator) -> bytes:
    """A block left out, repeated, or put elsewhere."""
    a, b, c = sorted(rng.integers(len(data) + 1, size=3).tolist())
    middle = [b"", 2 * data[a:b], data[b:c] + data[a:b]][rng.integers(3)]
    return data[:a] + middle + data[b:]


def _token(data: bytes, rng: np.random.Generator) -> bytes:
    """A text in the place of up to ten bytes."""
    at = int(rng.integers(len(data) + 1))
    return data[:at] + TOKENS[rng.integers(len(TOKENS))] + data[at + int(rng.integers(10)) :]


def _cells(data: bytes, rng: np.random.Generator) -> bytes:
    """A text in the place of all cells of a column, or of one in eight."""
    lines = data.split(b"\n")
    rows = [line.split(b",") for line in lines]
    column, token = int(rng.integers(4)), TOKENS[rng.integers(len(TOKENS))]
    share = (1.0, 0.125)[rng.integers(2)]
    for row in rows[1:]:
        if column < len(row) and rng.random() < share:
            row[column] = token
    return b"\n".join(b",".join(row) for row in rows)


def _lines(data: bytes, rng: np.random.Generator) -> bytes:
    """Lines in another order, or only a few of them."""
    lines = io.BytesIO(data).readlines()
    kept = rng.permutation(len(lines))[: int(rng.integers(1, len(lines) + 1)) if lines else 0]
    return b"".join(lines[k] for k in (np.sort(kept) if rng.random() < 0.5 else kept))


_KINDS: tuple[Callable[[bytes, np.random.Generator], bytes], ...] = (
    _cut, _flip, _block, _token, _token, _cells, _lines,
)  # fmt: skip
