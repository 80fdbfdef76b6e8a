"""Optional dependencies: modules of each extra, their versions, the error if one is missing."""

from collections.abc import Iterable
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec

from tautscope.errors import MissingExtraError

MODULES = {
    "analysis": ("matplotlib", "polars", "rich", "scipy"),
    "twin": ("cv2", "matplotlib", "mcap", "mujoco", "rich", "rosbags"),
    "console": ("cv2", "mcap", "rosbags", "websockets"),
    "ros2": ("cv2", "mcap", "rosbags", "zenoh"),
    "hardware": (
        "av",
        "can",
        "canopen",
        "cv2",
        "matplotlib",
        "mcap",
        "polars",
        "rich",
        "rosbags",
        "ruamel",
        "serial",
    ),
    "ethercat": ("pysoem",),
    "servo": ("rustypot",),
    "rerun": ("rerun",),
    "cluster": ("dask", "distributed"),
}
"""Extra -> modules that it installs for import."""


def installed_version(package: str) -> str:
    """The version of a package by its name on PyPI, or ``not installed``."""
    try:
        return version(package)
    except PackageNotFoundError:  # OpenCV has several packages
        return "not installed"


def missing_modules(extra: str) -> list[str]:
    """The modules of an extra that are not installed."""
    return [name for name in MODULES[extra] if find_spec(name) is None]


def require_module(name: str, what: str, extra: str) -> None:
    """Check that a module of an extra is installed; `what` needs it, for the error.

    Raises:
        MissingExtraError: It is not.
    """
    if find_spec(name) is None:
        raise MissingExtraError(what, (name,), (extra,))


def require_extras(what: str, extras: Iterable[str]) -> None:
    """Check that extras are installed.

    Args:
        what: What needs them, for the error: ``tautscope bench``.
        extras: Names of extras.

    Raises:
        MissingExtraError: A module of an extra is not installed.
    """
    incomplete = {extra: names for extra in extras if (names := missing_modules(extra))}
    if incomplete:
        modules = tuple(dict.fromkeys(name for names in incomplete.values() for name in names))
        raise MissingExtraError(what, modules, tuple(incomplete))
