"""Types and ranges of numbers that several sections share."""

from typing import Annotated

from msgspec import Meta

Positive = Annotated[float, Meta(gt=0)]
NonNegative = Annotated[float, Meta(ge=0)]
Fraction = Annotated[float, Meta(gt=0, lt=1)]
Gain = Annotated[float, Meta(ge=1, le=50)]
Vector3 = tuple[float, float, float]
PerDof = tuple[Positive, Positive, Positive]
"""One each for insertion, rotation and bending."""
LIMITS = "the lower limit, then the upper"
"""What a pair of limits is, for errors."""
MOST_RATIO = 30.0
"""Largest ratio of a number to its default, in either direction. Robots differ by less; a wrong
unit (mm for m, degrees for rad) or a digit too many is more."""
