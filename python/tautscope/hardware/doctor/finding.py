"""What a check found, in a form for people and for scripts."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import Any, Literal

from tautscope.errors import DriveError, FieldError, TautscopeError

Status = Literal["ok", "missing", "note"]


@dataclass(frozen=True, slots=True)
class Finding:
    """One thing that was looked at.

    Attributes:
        group: ``computer``, ``camera``, ``drives`` or ``recording``.
        what: What was looked at.
        status: ``ok``; ``missing``, a run needs it; ``note``, good to know and no more.
        found: What there is.
        todo: What to type or do; empty if there is nothing to do.
        data: The same in figures, for scripts.
    """

    group: str
    what: str
    status: Status
    found: str
    todo: str = ""
    data: dict[str, Any] = field(default_factory=dict)

    def to_json(self) -> dict[str, Any]:
        """Its attributes."""
        return asdict(self)


def absent(group: str, what: str, todo: str, *, needed: bool) -> Finding:
    """There is none; what to do about it, if one is `needed`."""
    if needed:
        return Finding(group, what, "missing", "none", todo)
    return Finding(group, what, "note", "none")


def failed(group: str, what: str, error: TautscopeError) -> Finding:
    """An error as a finding: what came, and what to do about it."""
    if isinstance(error, DriveError):
        return Finding(group, what, "missing", f"{error.node}: {error.what}", error.remedy)
    if isinstance(error, FieldError):
        found = f"{error.field}: {error.value}"
        return Finding(group, what, "missing", found, f"needed: {error.allowed}")
    return Finding(group, what, "missing", str(error))
