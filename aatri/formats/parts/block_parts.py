"""What one file or folder gives of a block: columns of its tables by ids, in its own order, frame and units told.

A reader of a format gives `BlockParts`, be it a whole project or a list of control points; `assembled` makes a Block
of the parts of one or several sources. The columns are those of `block_of` (`aatri.artifacts.builder`): metres,
millimetres on the image, radians. Beside them there are

    image_points   sigma_px      instead of sigma_mm: in pixels of the image's camera
    exterior       ground_from_image (n, 3, 3) instead of angles_rad: photogrammetric axes (x right, y up, looking
                   along -z) to the axes of `frame`; NaN where only the position is given

A standard deviation that the file does not state is left out or NaN; `assembled` gives it the one of the options.
`line` is the line in `files[0]`, unless `file` says another. Positions and attitudes are start values unless
`position_use` and `angle_use` say that they were observed.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from aatri.formats.conventions.pixel_origins import PixelAxes
from aatri.frames.conversion import Frame

LOCAL = Frame("local", ("x", "y", "z"), "local")
"""Cartesian, anywhere, of unknown scale: a free model."""

PLANE = Frame("local", ("east", "north", "up"), "local")
"""Coordinates of control or positions in metres, of no named system."""

Columns = Mapping[str, Any]
"""Columns of a table by name."""


@dataclass
class BlockParts:
    """What one file or folder gives of a block; a table without columns is one that the format does not have here."""

    format: str
    """Name of the format."""
    files: list[Path]
    """Read files; the columns `file` count in it."""
    name: str = ""
    frame: Frame | None = None
    """Of ground points, positions and rotations, axes in the order of the columns; None: the files do not say, so that
    they are taken to be in the frame of the block. `LOCAL`: a free model."""
    cameras: Columns = field(default_factory=dict)
    camera_parameters: Columns = field(default_factory=dict)
    """`camera`, `name`, `value`: of the distortion; all are held, unless `sigma` or `free` says more."""
    images: Columns = field(default_factory=dict)
    image_points: Columns = field(default_factory=dict)
    ground_points: Columns = field(default_factory=dict)
    exterior: Columns = field(default_factory=dict)
    pixel_axes: PixelAxes | None = None
    """What the image points count from; None: as the camera of their image says."""
    others: Columns = field(default_factory=dict)
    """Tables and attributes of a Block that are taken as they are, if this is the first source."""
    notes: list[str] = field(default_factory=list)
    """What the user should know of how it was read."""
