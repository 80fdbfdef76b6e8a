"""Data sets of LeRobot, v2.0 to v3.0: folders of Parquet files with episodes, as tables.

Layout: meta/info.json has the names of the numbers of each feature; data/chunk-*/*.parquet has the
rows, with the number of the episode in each: one file per episode up to v2.1, several in one file
since v3.0. Videos are not read. Source: github.com/huggingface/lerobot.
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from tautscope.errors import RecordError
from tautscope.extras import require_module
from tautscope.runs.array_files import first_line, with_single_numbers
from tautscope.runs.tables import Sheet, with_axes

EPISODE = "episode_index"
"""Column with the number of the episode."""
_INFO = Path("meta", "info.json")


@dataclass(frozen=True)
class Episode:
    """An episode of a data set."""

    number: int
    file: Path


def is_data_set(path: str | PathLike[str]) -> bool:
    """Whether a path is the folder of a data set."""
    return (Path(path) / _INFO).is_file()


def list_episodes(folder: str | PathLike[str]) -> list[Episode]:
    """All episodes of a data set, by number.

    Raises:
        MissingExtraError: Polars is not installed.
        RecordError: There is no episode, or a file is damaged.
    """
    require_module("polars", "reading a data set", "analysis")
    import polars as pl  # noqa: PLC0415  takes 0.3 s

    found = []
    for file in sorted(Path(folder).glob("data/**/*.parquet")):
        try:
            numbers = pl.read_parquet(file, columns=[EPISODE])[EPISODE].unique().to_list()
            found += [Episode(int(number), file) for number in numbers]
        except (Exception, pl.exceptions.PanicException) as error:  # any, of a damaged file
            raise _damaged(file, error) from None
    if not found:
        raise RecordError(f"{folder}/data", "no episode", "chunk-000/episode_000000.parquet, ...")
    return sorted(found, key=lambda each: each.number)


def open_episode(folder: str | PathLike[str], episode: Episode) -> Sheet:
    """An episode as a table; the numbers of a feature are FEATURE.NAME, or FEATURE.1, ...

    A damaged file is a `RecordError`.
    """
    import polars as pl  # noqa: PLC0415

    names = _names(Path(folder) / _INFO)
    try:
        rows = pl.scan_parquet(episode.file).filter(pl.col(EPISODE) == episode.number)
        used = [name for name, kind in rows.collect_schema().items() if _is_numeric(kind)]
        frame = with_single_numbers(rows.select(used).collect(), names)
    except (Exception, pl.exceptions.PanicException) as error:  # any, of a damaged file
        raise _damaged(episode.file, error) from None
    file = f"{folder}, episode {episode.number}"
    lines = np.arange(1, len(frame) + 1)
    return with_axes(Sheet(file, frame, frame.columns, [], [], lines, "row"))


def _is_numeric(kind: Any) -> bool:
    inner = getattr(kind, "inner", kind)
    return bool(inner.is_numeric())


def _names(file: Path) -> dict[str, list[str]]:
    """Feature -> names of its numbers, where the data set has a name for each."""
    allowed = "features, each with names or null"
    try:
        features = json.loads(file.read_text(encoding="utf-8"))["features"]
        return {key: list(_flat(feature.get("names"))) for key, feature in features.items()}
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise RecordError(str(file), f"{type(error).__name__}: {error}", allowed) from None


def _flat(names: Any) -> list[str]:
    """Names from a list, or from ``{"motors": [...]}`` or ``{"x": 0, "y": 1}``."""
    if isinstance(names, Mapping):
        lists = [each for each in names.values() if isinstance(each, list)]
        names = lists[0] if len(lists) == 1 else list(names)
    return [str(each) for each in names or ()]


def _damaged(file: Path, error: BaseException) -> RecordError:
    with file.open("rb") as stream:
        is_pointer = stream.read(40).startswith(b"version https://git-lfs")
    if is_pointer:
        return RecordError(str(file), "a pointer of Git LFS", "the file itself: git lfs pull")
    return RecordError(str(file), first_line(error), f"a Parquet file with a column {EPISODE}")
