"""The package tautscope_node is a colcon package: it is imported from its folder."""

import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "ros" / "tautscope_node"))
sys.path.insert(0, str(ROOT / "examples" / "cpp"))
