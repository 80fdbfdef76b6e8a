"""Types of numbers that several blocks share."""

from typing import Annotated

from msgspec import Meta

Positive = Annotated[float, Meta(gt=0)]
NonNegative = Annotated[float, Meta(ge=0)]
Fraction = Annotated[float, Meta(gt=0, lt=1)]
Gain = Annotated[float, Meta(ge=1, le=50)]
Vector3 = tuple[float, float, float]
PerDof = tuple[Positive, Positive, Positive]
"""One each for insertion, rotation and bending."""
