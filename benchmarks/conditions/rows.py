"""Rows and table of the condition benchmark."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from common.rows import goal_row
from conditions.frames import CONDITIONS, MIN_VISIBLE, MODES, Evaluation


@dataclass(frozen=True)
class Quantity:
    """Quantity measured on frames, with its goal: an upper ("max") or a lower ("min") limit."""

    what: str
    unit: str
    goal: float
    sense: str
    measure: Callable[[Sequence[Evaluation], int], float | None]

    def is_reached(self, value: float) -> bool:
        """Return whether the value reaches the goal."""
        return value <= self.goal if self.sense == "max" else value >= self.goal


def valid_share(frames: Sequence[Evaluation], mode: int) -> float | None:
    """Return the share of valid ones among frames with visible markers [%]; None without any."""
    valid = [each.valid[mode] for each in frames if each.visible >= MIN_VISIBLE]
    return 100 * float(np.mean(valid)) if valid else None


def wrong_accepted(frames: Sequence[Evaluation], mode: int) -> float | None:
    """Return the share of frames with an accepted wrong marker [%]."""
    return 100 * float(np.mean([each.is_wrong(mode) for each in frames]))


def marker_error(frames: Sequence[Evaluation], mode: int) -> float | None:
    """Return the RMS error of the markers of all valid frames [px], wrong ones included."""
    errors = [each.error[mode] for each in frames if each.valid[mode]]
    values = np.concatenate(errors) if errors else np.empty(0)
    values = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(values**2))) if values.size else None


def quantities(profile: str, mode: int) -> tuple[Quantity, ...]:
    """Return the quantities of one condition and mode with their goals."""
    is_empty = profile.startswith("no instrument")
    return (
        Quantity("valid", "%", 99.0 if mode == 0 else 97.0, "min", valid_share),
        Quantity("wrong accepted", "%", 0.0 if is_empty else 0.1, "max", wrong_accepted),
        Quantity("marker error", "px", 0.15 if profile == "clean" else 0.5, "max", marker_error),
    )


def to_rows(frames: Sequence[Evaluation]) -> list[dict[str, Any]]:
    """Return one row per condition, mode and quantity.

    `median` and `worst` are over seeds, `pooled` over all frames; `holds` is for `pooled`.
    """
    rows: list[dict[str, Any]] = []
    for profile in (*CONDITIONS, "all"):
        own = [each for each in frames if profile in (each.condition, "all")]
        seeds = sorted({each.seed for each in own})
        if not own:
            continue
        for mode, label in enumerate(MODES):
            for quantity in quantities(profile, mode):
                pooled = quantity.measure(own, mode)
                if pooled is None:
                    continue
                parts = [
                    quantity.measure([each for each in own if each.seed == seed], mode)
                    for seed in seeds
                ]
                values = [part for part in parts if part is not None]
                row = goal_row(
                    f"{quantity.what}, {label}",
                    quantity.unit,
                    values,
                    quantity.goal,
                    quantity.sense,
                    profile=profile,
                    n=len(own),
                )
                visible = sum(each.visible >= MIN_VISIBLE for each in own)
                row |= {"pooled": pooled, "n_visible": visible, "seeds": len(seeds)}
                rows.append(row | {"holds": quantity.is_reached(pooled)})
    return rows


def table(rows: Sequence[dict[str, Any]]) -> str:
    """Return a Markdown table: both modes of each condition that misses a goal, and of all."""
    lines = [
        "| condition | valid [%] | wrong accepted [%] | error [px] "
        "| without prediction: valid | wrong accepted | error |",
        "|---|" + "--:|" * 6,
    ]
    held = []
    for profile in (*CONDITIONS, "all"):
        own = {row["what"]: row for row in rows if row["profile"] == profile}
        if profile != "all" and all(row["holds"] for row in own.values()):
            held += [profile] * bool(own)
            continue
        cells = [profile]
        for label in MODES:
            for what, form in (
                ("valid", ".1f"),
                ("wrong accepted", ".2f"),
                ("marker error", ".2f"),
            ):
                row = own.get(f"{what}, {label}")
                mark = "" if row is None or row["holds"] else " (!)"
                cells.append("-" if row is None else f"{row['pooled']:{form}}{mark}")
        lines.append("| " + " | ".join(cells) + " |")
    if held:
        lines += ["", f"Every goal is held with {', '.join(held)}."]
    return "\n".join(lines)
