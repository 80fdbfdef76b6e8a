"""Write the table of reactions of supervision/reactions.rs into docs/safety.md."""

from __future__ import annotations

import re

from doc_pages import ROOT, insert

PAGE = ROOT / "docs" / "safety.md"
SOURCE = ROOT / "crates" / "core" / "src" / "supervision" / "reactions.rs"

_LADDER = re.compile(r"const (\w+): &\[\(Reaction, Clear\)\] = &(\[.*?\]);")
_RULE = re.compile(r"rule\(Flag::(\w+),\s*(\w+),\s*(&\[.*?\]|\w+),\s*(true|false)\s*\)", re.DOTALL)
_RUNG = re.compile(r"\((\w+), (\w+)\)")


def table() -> str:
    """A line per flag."""
    source = SOURCE.read_text(encoding="utf-8")
    ladders = dict(_LADDER.findall(source))
    lines = ["| flag | noticed at | reactions, and what ends each | climbs |", "|---|---|---|---|"]
    for flag, seen, ladder, climbs in _RULE.findall(source):
        rungs = _RUNG.findall(ladders.get(ladder, ladder))
        steps = ", then ".join(f"{snake(what)} ({snake(end)})" for what, end in rungs)
        again = "yes" if climbs == "true" else ""
        lines.append(f"| {snake(flag)} | {snake(seen)} | {steps} | {again} |")
    return "\n".join(lines)


def snake(name: str) -> str:
    """HoldEstimate to hold_estimate."""
    return re.sub(r"(?<!^)(?=[A-Z])", "_", name).lower()


if __name__ == "__main__":
    insert(PAGE, "reactions", table())
