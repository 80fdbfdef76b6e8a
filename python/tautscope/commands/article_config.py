"""Configurations of the article's instrument, which most commands are for."""

from __future__ import annotations

from os import PathLike

from tautscope.config import Config, Profile, load_config
from tautscope.errors import ConfigError


def article_config(
    path: str | PathLike[str] | None = None, profile: Profile | None = None
) -> Config:
    """As `load_config`, of the article's instrument.

    Raises:
        ConfigError: As `load_config`; the configuration has [[dof]].
    """
    config = load_config(path, profile)
    if config.dof:
        found = ", ".join(dof.name for dof in config.dof)
        allowed = (
            "none: this is for the article's instrument. docs/robots.md has what other robots use"
        )
        raise ConfigError("dof", found, allowed)
    return config
