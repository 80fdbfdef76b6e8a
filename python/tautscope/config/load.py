"""Reading and writing of TOML."""

import logging
import tomllib
from collections.abc import Iterable, Sequence
from numbers import Integral
from os import PathLike
from pathlib import Path
from typing import Any

from tautscope._core import MOST_DOFS
from tautscope.config.root import Config, Profile, from_document, to_document
from tautscope.config.section import without_numpy
from tautscope.errors import ConfigError, MissingPathError

_LOG = logging.getLogger(__name__)
_RIGS = Path(__file__).with_name("rigs")
RIGS = tuple(sorted(file.stem for file in _RIGS.glob("*.toml")))
"""Names of the configurations that come with the package."""


def load_config(path: str | PathLike[str] | None = None, profile: Profile | None = None) -> Config:
    """Read a TOML configuration; missing keys have their defaults.

    Args:
        path: TOML file, or one of `RIGS`; by default the article's experiment.
        profile: ``"paper"`` or ``"best"``; by default that of the file, else ``"best"``.

    Raises:
        MissingPathError: The file does not exist.
        ConfigError: It is not TOML, or a key is unknown, of the wrong type or out of range; the
            error names the key, its value and the allowed values.
    """
    changes = {} if profile is None else {"profile": profile}
    if path is None:
        return from_document(changes)
    file = config_file(path)
    try:
        document = tomllib.loads(file.read_text(encoding="utf-8"))
    except OSError:
        raise MissingPathError("config", str(file), "a readable TOML file") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError, RecursionError) as error:
        raise ConfigError("config", str(file), f"TOML ({error})") from None
    _LOG.info("configuration: %s", file.absolute())
    _resolve_paths(document, file.absolute().parent)
    return from_document(document | changes)


def config_file(path: str | PathLike[str]) -> Path:
    """The file of a configuration: a path, or one of `RIGS` if there is no such file."""
    file = Path(path)
    return _RIGS / f"{path}.toml" if str(path) in RIGS and not file.exists() else file


def dump_config(config: Config) -> str:
    """The configuration as TOML with every key; `load_config` reads it back equal."""
    import tomlkit  # noqa: PLC0415  only writing needs it

    return tomlkit.dumps(to_document(config))


def _resolve_paths(document: dict[str, Any], folder: Path) -> None:
    """Make paths in the document relative to the folder of the TOML file."""
    drives = document.get("drives")
    if not isinstance(drives, dict):
        return
    named = drives.get("motors")
    for axis in [*drives.values(), *(named.values() if isinstance(named, dict) else ())]:
        if isinstance(axis, dict) and isinstance(axis.get("eds"), str):
            axis["eds"] = str(folder / axis["eds"])


def axes(
    count: int,
    *,
    width_limit: float | Sequence[float],
    unit: str | Sequence[str] = "rad",
    names: Sequence[str] | None = None,
    **keys: Any,
) -> Config:
    """The shortest configuration of a robot: degrees of freedom that are measured as they are.

    Args:
        count: How many, 1 to 8.
        width_limit: Largest width of the slack that is compensated [m or rad], one or one each.
        unit: "m" or "rad", one or one each.
        names: By default ``axis_1``, ``axis_2``, ...
        keys: Further keys of each degree of freedom (`DofEntry`), one or a list of one each.

    Raises:
        ConfigError: A value is out of range, or a list has another length.
    """
    if not isinstance(count, Integral) or count not in range(1, MOST_DOFS + 1):
        raise ConfigError("count", count, f"1 to {MOST_DOFS}")
    if names is not None and not isinstance(names, Iterable):
        raise ConfigError("names", names, f"a list of {count}")
    named = [f"axis_{index + 1}" for index in range(count)] if names is None else list(names)
    given = {"name": named, "width_limit": width_limit, "unit": unit, **keys}
    columns: dict[str, Sequence[Any]] = {}
    for key, value in without_numpy(given).items():
        is_list = isinstance(value, Sequence) and not isinstance(value, str)
        if key == "range" and is_list and value and not isinstance(value[0], Sequence):
            is_list = False  # one range for all
        columns[key] = value if is_list else [value] * count
        if len(columns[key]) != count:
            raise ConfigError(key, value, f"one value, or {count}")
    rows = zip(*columns.values(), strict=True)
    return from_document({"dof": [dict(zip(columns, row, strict=True)) for row in rows]})
