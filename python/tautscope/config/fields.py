"""Types and ranges of numbers that several sections share."""

from typing import Annotated

from msgspec import Meta

Positive = Annotated[float, Meta(gt=0)]
NonNegative = Annotated[float, Meta(ge=0)]
Fraction = Annotated[float, Meta(gt=0, lt=1)]
Gain = Annotated[float, Meta(ge=1, le=50)]
Vector3 = tuple[float, float, float]
Angle = Annotated[float, Meta(ge=-7, le=7)]
"""Of any rotation in rad; in degrees most are more."""
Coordinate = Annotated[float, Meta(ge=-10, le=10)]
"""Of a position in m, or a time in s; in mm and ms most are more."""
Rotation = tuple[Angle, Angle, Angle]
Position = tuple[Coordinate, Coordinate, Coordinate]
PerDof = tuple[Positive, Positive, Positive]
"""One each for insertion, rotation and bending."""
LIMITS = "the lower limit, then the upper"
"""What a pair of limits is, for errors."""
MOST_RATIO = 30.0
"""Largest ratio of a number to its default, in either direction. Robots differ by less; a wrong
unit (mm for m, degrees for rad) or a digit too many is more."""
