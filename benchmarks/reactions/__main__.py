"""Write the table of reactions of crates/core/src/supervision/reactions.rs to docs/safety.md."""

import re
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from common.doc_pages import insert
from common.paths import ROOT

PAGE = ROOT / "docs" / "safety.md"
SOURCE = ROOT / "crates" / "core" / "src" / "supervision" / "reactions.rs"

_LADDER = re.compile(r"const (\w+): &\[\(Reaction, Clear\)\] = &(\[.*?\]);")
_RULE = re.compile(r"rule\(Flag::(\w+),\s*(\w+),\s*(&\[.*?\]|\w+),\s*(true|false)\s*\)", re.DOTALL)
_RUNG = re.compile(r"\((\w+), (\w+)\)")


def table() -> str:
    """Return the table, a line for all flags with the same reactions."""
    source = SOURCE.read_text(encoding="utf-8")
    ladders = dict(_LADDER.findall(source))
    found: dict[tuple[str, str], list[str]] = {}
    for flag, source_tick, ladder, climbs in _RULE.findall(source):
        rungs = _RUNG.findall(ladders.get(ladder, ladder))
        joint = ", then " if climbs == "true" else ", or "
        steps = joint.join(f"{snake(what)} ({snake(end)})" for what, end in rungs)
        found.setdefault((snake(source_tick), steps), []).append(snake(flag))
    lines = ["| flags | detected at | reactions, and what ends each |", "|---|---|---|"]
    lines += [
        f"| {', '.join(flags)} | {tick} | {steps} |" for (tick, steps), flags in found.items()
    ]
    return "\n".join(lines)


def snake(name: str) -> str:
    """Convert HoldEstimate to hold_estimate."""
    return re.sub(r"(?<!^)(?=[A-Z])", "_", name).lower()


if __name__ == "__main__":
    insert(PAGE, "reactions", table())
