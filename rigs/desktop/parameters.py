"""Every dimension of the desktop rig [mm], and what the configuration needs of them.

x is the direction of insertion, z is up, z = 0 is the table; y = 0 is the instrument's axis.
"Measured" is from the STEP model of the servo in the SO-ARM100 project (README.md, "Sources").
"""

from __future__ import annotations

import math

# Servo Feetech STS3215. Measured, relative to its output axis: its long side is "along".
SERVO_AHEAD = 10.2
"""From the axis to the near end of the case."""
SERVO_BEHIND = 35.2
SERVO_WIDTH = 24.8
SERVO_DEPTH = 31.8
"""Between the two faces with screw holes."""
SERVO_REAR = 3.5
"""What the rear disc and the plugs stand out at the back."""
HORN_RADIUS = 10.0
HORN_STAND = 2.8
"""From the face of the case to the end of the horn."""
HORN_THICKNESS = 2.5
HORN_SCREWS = 7.0
"""Radius of the circle of four M3 holes in the horn."""
HORN_BOLT = (3.5, 1.5)
"""Radius and height of the head of the screw in the horn's centre."""
FACE_SCREWS = ((8.3, 10.25), (29.0, 10.25))
"""Holes for M2 self-tapping screws in the face: along, and to both sides."""

# Linear guide MGN12 with two blocks MGN12H. From the maker's catalogue; see README.md.
RAIL_WIDTH, RAIL_HEIGHT, RAIL_LENGTH, RAIL_PITCH = 12.0, 8.0, 200.0, 25.0
BLOCK_LENGTH, BLOCK_WIDTH, GUIDE_HEIGHT, BLOCK_GAP = 45.4, 27.0, 13.0, 3.0
BLOCK_SCREWS = 10.0
"""Half of the distance of the M3 holes, in both directions."""

# Ball bearing 61900-2Z (6900ZZ), ISO 15.
BEARING_BORE, BEARING_OUTSIDE, BEARING_WIDTH = 10.0, 22.0, 6.0

# Brass tubes, PTFE tube, forceps, camera: outside diameters, and bores.
INNER_TUBE = (3.0, 2.5)
OUTER_TUBE = (4.0, 3.1)
CHANNEL = (4.0, 3.0)
SHEATH = 2.4
"""Largest diameter of the forceps' coil."""
WIRE = 0.6
"""Largest diameter of the forceps' wire."""
CAMERA = 8.0
"""Diameter of the USB borescope."""
CAMERA_OFFSET = 20.0
"""From the axis of the channel up to the camera's front."""
CAMERA_BACK = 15.0
"""From the camera's front to the end of the channel, which stands out of the head."""
CAMERA_TILT = 0.35
"""Of the camera towards the instrument [rad]."""

# Screws: clearance holes, heads, heat-set inserts of 4 mm.
M3, M3_HEAD, M3_HEAD_HEIGHT, M3_INSERT, M3_NUT, M3_TAPPED = 3.4, 6.2, 3.2, 4.0, 5.8, 2.7
M2, M4_TAPPED, DOWEL = 2.4, 3.5, 3.0

# Printing.
BED = 220.0
PRESS = 0.05
"""On the radius, for bearings and tubes that are pressed in."""
SLIDE = 0.2
"""On the radius, for parts that slide or turn."""
POCKET = 0.2
"""On each side of a servo."""

# Gears: involute, 20 degrees.
MODULE = 1.0
PINION_TEETH = 24
SERVO_GEAR_TEETH = 48
ROTOR_GEAR_TEETH = 24
GEAR_WIDTH = 8.0
MESH = 0.15
"""Increase of the centre distances."""
THINNING = 0.1
"""Decrease of each tooth's thickness on the pitch circle."""
RACK_LENGTH = 100.0

# Cam of the bending stage: a spiral groove that moves a pin.
CAM_LEAD = 16.0
"""Travel of the pin per turn."""
CAM_START = 14.0
"""Radius of the pin at the lower end of the bending's travel."""
CAM_MARGIN = 1.0
"""Groove beyond both ends of the travel."""
CAM_RADIUS, CAM_THICKNESS, CAM_GROOVE = 27.5, 6.0, 3.5

# Instrument's tip.
TIP_DIAMETER = 6.0
SECTION_LENGTH = 18.5
TIP_LENGTH = 20.0
BAND_A, BAND_B, BAND_LENGTH = 4.0, 16.0, 4.0
"""Centres of the bands from the bending section, as in the configuration."""
CORE_DIAMETER = 5.0
SPINE = 1.5
"""Thickness of the bending section's spine."""
NOTCHES, NOTCH, NOTCH_PITCH, NOTCH_START = 8, 1.15, 1.7, 3.1
"""Number, width, distance, and where the first begins."""
COIL_SEATS = (2.5, 2.0)
"""Depth of the coil in the proximal and the distal end of the bending section."""

# Phantom.
BEND_RADIUS = 50.0
BEND_PITCH = 8.0

# Travel of each degree of freedom: mm, rad, rad.
INSERTION = (0.0, 60.0)
ROTATION = (-4.0, 4.0)
BENDING = (-0.8, 3.0)

# Places.
BASE_THICKNESS = 6.0
PLATE = 6.0
"""Thickness of the plates on the blocks."""
SKIN = 3.0
"""Thickness of a plate under the face of a servo."""
HEADS = 2.2
"""From a plate to the gear or cam above it: the heads of the M2 screws."""
AXIS = 41.0
"""Height of the instrument's axis."""
HOME = -14.0
"""Centre of the carriage's block at insertion 0."""
RAIL_CENTRE = -4.0
PINION_Y = 45.0
TOWER = (6.0, 14.0)
"""Plate of the tower, from and to, from the block's centre."""
NOSE = 36.2
"""Distal end of the rotor."""
ROTOR_REAR = -22.0
CAM_X = -47.0
PIN_X = -8.0
"""Of the pin, from the centre of the slider's block."""
CAM_BOTTOM = 55.5

PLATE_BOTTOM = BASE_THICKNESS + GUIDE_HEIGHT
PLATE_TOP = PLATE_BOTTOM + PLATE
PINION_RADIUS = MODULE * PINION_TEETH / 2
GEAR_DISTANCE = MODULE * (SERVO_GEAR_TEETH + ROTOR_GEAR_TEETH) / 2 + MESH
HUB = SKIN - HORN_STAND + HEADS
"""Length of the hub between a horn and its gear or cam."""
ARM = (TIP_DIAMETER - SPINE) / 2
"""From the wire to the neutral line of the spine: travel of the wire per rad."""
COUNTS = 4096


def counts_per_unit() -> tuple[float, float, float]:
    """Counts of the servos per m, rad and rad of the instrument at its root."""
    insertion = COUNTS / (2 * math.pi * PINION_RADIUS) * 1e3
    rotation = COUNTS / (2 * math.pi) * ROTOR_GEAR_TEETH / SERVO_GEAR_TEETH
    bending = COUNTS * ARM / CAM_LEAD
    return insertion, rotation, bending


def travel() -> tuple[tuple[float, float], ...]:
    """Travel of the three degrees of freedom [m, rad, rad]."""
    return (INSERTION[0] / 1e3, INSERTION[1] / 1e3), ROTATION, BENDING


def home() -> tuple[float, ...]:
    """Position at 0 counts, with half a turn of the servo in the middle of the travel."""
    pairs = zip(travel(), counts_per_unit(), strict=True)
    return tuple((low + high) / 2 - COUNTS / 2 / counts for (low, high), counts in pairs)


def camera_from_guide() -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Pose of the channel's end in the camera's frame: translation [m], rotation vector [rad]."""
    cosine, sine = math.cos(CAMERA_TILT), math.sin(CAMERA_TILT)
    down = CAMERA_OFFSET * cosine - CAMERA_BACK * sine
    forward = CAMERA_OFFSET * sine + CAMERA_BACK * cosine
    return (0.0, down / 1e3, forward / 1e3), (CAMERA_TILT, 0.0, 0.0)


def pin_radius(bending: float) -> float:
    """Distance of the pin from the cam's axis at a bending [rad]."""
    return CAM_START + ARM * (bending - BENDING[0])


def slider_x(bending: float) -> float:
    """Centre of the slider's block from that of the carriage, at a bending [rad]."""
    return CAM_X - pin_radius(bending) - PIN_X
