"""Results of checks, for people and for scripts."""

from dataclasses import dataclass, field
from typing import Any, Literal

from tautscope.errors import DriveError, FieldError, TautscopeError

Status = Literal["ok", "missing", "note"]


@dataclass(frozen=True, slots=True)
class CheckResult:
    """The result of one check.

    Attributes:
        group: ``computer``, ``camera``, ``drives``, ``calibration``, ``recording``, or ``rig``
            of a rig of one's own.
        what: The object of the check.
        status: ``ok``; ``missing`` if a run needs it; ``note`` for information.
        found: The result in words.
        todo: What to type or do; empty if nothing.
        data: The result in numbers, for scripts.
    """

    group: str
    what: str
    status: Status
    found: str
    todo: str = ""
    data: dict[str, Any] = field(default_factory=dict)


def result(
    group: str, what: str, found: str, data: dict[str, Any], *, missing: str = "", note: str = ""
) -> CheckResult:
    """The result of a check: ok without the remedies `missing` and `note`."""
    status: Status = "missing" if missing else "note" if note else "ok"
    return CheckResult(group, what, status, found, missing or note, data)


def none_found(group: str, what: str, todo: str, *, needed: bool) -> CheckResult:
    """The result of a search without a hit, with a remedy if one is `needed`."""
    return CheckResult(group, what, "missing" if needed else "note", "none", todo if needed else "")


def from_error(group: str, what: str, error: TautscopeError) -> CheckResult:
    """The result of a check that raised an error."""
    if isinstance(error, DriveError):
        return CheckResult(group, what, "missing", f"{error.node}: {error.what}", error.remedy)
    if isinstance(error, FieldError):
        found = f"{error.field}: {error.value}"
        return CheckResult(group, what, "missing", found, f"needed: {error.allowed}")
    return CheckResult(group, what, "missing", str(error))
