"""tautscope."""

from tautscope._core import __version__

__all__ = ["__version__"]
