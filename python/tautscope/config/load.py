"""TOML in and out."""

from __future__ import annotations

import tomllib
from os import PathLike
from pathlib import Path
from typing import Any

import tomli_w

from tautscope.config.root import Config, Profile, from_document, to_document
from tautscope.errors import ConfigError, MissingPathError


def load_config(path: str | PathLike[str] | None = None, profile: Profile | None = None) -> Config:
    """Read a TOML configuration; keys that are not named keep their defaults.

    Args:
        path: TOML file; without it, the article's experiment.
        profile: ``"paper"`` or ``"best"``; without it, what the file says, else ``"paper"``.

    Raises:
        MissingPathError: The file is not there.
        ConfigError: It is not TOML, or a key is unknown, of the wrong type or out of range; the
            error names the key, what came and what may come.
    """
    changes = {} if profile is None else {"profile": profile}
    if path is None:
        return from_document(changes)
    file = Path(path)
    try:
        document = tomllib.loads(file.read_text(encoding="utf-8"))
    except (FileNotFoundError, IsADirectoryError):
        raise MissingPathError("config", str(file), "a TOML file that is there") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ConfigError("config", str(file), f"TOML ({error})") from None
    _place_files(document, file.absolute().parent)
    return from_document(document | changes)


def dump_config(config: Config) -> str:
    """The configuration as TOML, every key written out; `load_config` reads it back equal."""
    return tomli_w.dumps(to_document(config))


def _place_files(document: dict[str, Any], folder: Path) -> None:
    """Files that a TOML file names are beside it, wherever the program runs."""
    drives = document.get("drives")
    for axis in drives.values() if isinstance(drives, dict) else ():
        if isinstance(axis, dict) and isinstance(axis.get("eds"), str):
            axis["eds"] = str(folder / axis["eds"])
