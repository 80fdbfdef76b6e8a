"""Reading and writing of TOML."""

from __future__ import annotations

import logging
import tomllib
from os import PathLike
from pathlib import Path
from typing import Any

from tautscope.config.root import Config, Profile, from_document, to_document
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
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
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
    for axis in drives.values() if isinstance(drives, dict) else ():
        if isinstance(axis, dict) and isinstance(axis.get("eds"), str):
            axis["eds"] = str(folder / axis["eds"])
