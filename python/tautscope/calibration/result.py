"""The result of a calibration: values of a configuration and how well they are known."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class CalibrationResult:
    """Values found by one kind of calibration.

    Attributes:
        kind: ``camera``, ``colour``, ``geometry``, ``latency`` or ``robot``; or a step without
            values of ``tautscope calibrate all``.
        values: Dotted path of a key -> value, as for `Config.replace`.
        std: Standard deviation by dotted path, ``camera.distortion[0]`` for an item of a list.
        residual: Root mean square of the residuals [px], or None.
        serial_numbers: Serial numbers of the devices that took part: camera, insertion, ...
        notes: What a person should know, a sentence each.
        figures: Figures with their captions.
        data: Further results, for scripts.
    """

    kind: str
    values: Mapping[str, Any]
    std: Mapping[str, float] = field(default_factory=dict)
    residual: float | None = None
    serial_numbers: Mapping[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    figures: tuple[tuple[Figure, str], ...] = ()
    data: Mapping[str, Any] = field(default_factory=dict)

    def changes(self, at: datetime | None = None) -> dict[str, Any]:
        """The values and the record of the calibration, for `write_values` and `Config.replace`.

        An infinite standard deviation, that of a value which is not determined, is not recorded.

        Args:
            at: When it was done; now by default.
        """
        record: dict[str, Any] = {
            "date": (at or datetime.now(UTC)).isoformat(timespec="seconds"),
            "serial_numbers": dict(self.serial_numbers),
            "std": {k: rounded(std, std) for k, std in self.std.items() if math.isfinite(std)},
        }
        if self.residual is not None:
            record["residual"] = rounded(self.residual, self.residual)
        return {**self.rounded_values(), f"calibration.{self.kind}": record}

    def rounded_values(self) -> dict[str, Any]:
        """The values, rounded to a twentieth of their standard deviations or finer."""
        return {key: self._rounded(key, value) for key, value in self.values.items()}

    def _rounded(self, key: str, value: Any) -> Any:
        if isinstance(value, float):
            return rounded(value, self.std.get(key, 0.0))
        if isinstance(value, tuple | list):
            return [self._rounded(f"{key}[{k}]", item) for k, item in enumerate(value)]
        return value


def rounded(value: float, std: float) -> float:
    """The value with two significant digits of its standard deviation; six of its own if 0."""
    scale = std if std > 0 and math.isfinite(std) else abs(value) * 1e-4
    if not scale:
        return value
    return round(value, 1 - math.floor(math.log10(scale)))
