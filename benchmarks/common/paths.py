"""Paths that the benchmarks share."""

import os
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
"""Root of the repository."""
DATA = Path(os.environ.get("TAUTSCOPE_DATA", ROOT.parent / "shared" / "data"))
"""Folder of real data (colon frames, records of tools), which are not in the repository."""
