"""Classes of the user, by the name of their module and their own."""

import sys
from importlib import import_module
from pathlib import Path
from typing import Any

from tautscope.errors import ConfigError


def named_class(field: str, name: str, allowed: str) -> Any:
    """The class of ``module:Class``; the module may be in the working directory.

    If there is none, a `ConfigError` names `field`, and what is `allowed`.
    """
    module, _, attribute = name.partition(":")
    if not module or not attribute or module.startswith("."):
        raise ConfigError(field, name, allowed)
    here = str(Path.cwd())
    if here not in sys.path:
        # A console script has its own folder there, not the one in which it was called.
        sys.path.append(here)
    try:
        return getattr(import_module(module), attribute)
    except (ImportError, AttributeError) as error:
        raise ConfigError(field, name, f"{allowed} ({error})") from None


def instance(field: str, name: str, found: Any) -> Any:
    """What a class of the user makes without arguments; a `ConfigError` if it needs some."""
    try:
        return found()
    except TypeError as error:
        raise ConfigError(field, name, f"a class without arguments ({error})") from None
