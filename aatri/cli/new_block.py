"""Templates of a block folder: block.yaml and the tables, commented, to be filled in, by what the images are."""

from pathlib import Path

from aatri.errors import ResourceError

BLOCK_YAML = """\
# What this block is. Every key is described in docs/formats.md; keys that start with x_ are yours and are ignored.
aatri_block: 1
name: my block
frames:                                  # the first is the frame of the tables; axes in the order of X, Y, Z there
  map: {axes: [east, north, up], crs: local}     # crs: EPSG:32650 or other pyproj text; vertical: EPSG:5773
# earth_curvature: correct               # correct (map frame) | ignore (local Cartesian frame)
units: {ground: m, angle: deg, sigma_image: um, sigma_ground: m, sigma_angle: deg, time: s}
rotation: omega-phi-kappa                # of a1, a2, a3 in exterior.csv: or phi-omega-kappa, roll-pitch-heading
sigma: {image: 5, fiducial: 5, control: [0.02, 0.02, 0.03], position: [0.1, 0.1, 0.1], attitude: [0.01, 0.01, 0.02]}
# terrain_height: 100                    # mean height of the terrain, m
cameras:
  cam:
@CAMERA@"""

CAMERAS = {
    "digital": """\
    kind: digital
    image_coordinates: pixel             # image_points.csv is in pixels; photo: in mm, see `aatri new --block reduced`
    pixel: {size: 0.004, origin: top-left-corner, y: down}       # size in mm
    format: [6000, 4000]                 # columns, rows
""",
    "film": """\
    kind: film
    image_coordinates: comparator        # as measured, mm, y up; a scan: pixel, with pixel: {size, origin, y}
    format: [230, 230]                   # mm
    fiducials: {"1": [106.0, -106.0], "2": [-106.0, -106.0], "3": [-106.0, 106.0], "4": [106.0, 106.0]}   # mm
""",
    "reduced": """\
    kind: film                           # film | digital
    image_coordinates: photo             # mm from the fiducial or image centre, x right, y up; reduced already
    format: [230, 230]                   # mm of film; columns, rows of a digital image
""",
}
"""What block.yaml says of the camera, by what was measured."""

_LENS = """\
    principal_distance: @C@            # mm
    principal_point: [0.0, 0.0]          # mm, x right, y up; [0, 0] where coordinates count from it already
    distortion: {model: none}            # none | brown | table | opencv | polynomial | fisheye | bal
    # sigmas: {principal_distance: .inf, principal_point: [.inf, .inf]}      # 0 fixed, .inf free, else weighted
"""

TABLES = {
    "images.csv": """\
# One row per image. strip and sequence (ascending along the flight) are needed by strips, not by a bundle.
# i1,cam,1,1
image,camera,strip,sequence
""",
    "image_points.csv": """\
# One row per measured point and image, in the coordinates that the camera names. sx, sy may be left empty.
# i1,p1,1200.5,830.25,,
image,point,x,y,sx,sy
""",
    "ground_points.csv": """\
# Known points. role: control (default), check, approximate, ignore, or XY:control Z:check. Sigma 0 is exact.
# p1,1000.00,2000.00,50.00,,,,control
point,X,Y,Z,sX,sY,sZ,role
""",
    "exterior.csv": """\
# Positions and attitudes of images: observed where a standard deviation is given, else start values. \
Delete it if there are none.
# i1,1000.0,2000.0,800.0,0.1,0.1,0.1,,,,,,
image,X,Y,Z,sX,sY,sZ,a1,a2,a3,s1,s2,s3
""",
    "fiducials.csv": """\
# Measured fiducial marks of film. Delete it if there are none.
# i1,1,216.1,4.2
image,fiducial,x,y
""",
    "geodetic.csv": """\
# Distances, directions, angles, height differences ... between points. Delete it if there are none.
# distance,p1,p2,141.42,0.003
type,from,to,value,sigma
""",
    "covariances.csv": """\
# Covariances of geodetic observations (rows of geodetic.csv from 1) or of control (ids and coordinates). \
Delete it if there are none.
# ground_points,p1,X,p2,X,0.0001
table,row_a,coord_a,row_b,coord_b,value
""",
    "relative_control.yaml": """\
# Conditions on points: sigma makes one an observation, exact: true a constraint. Delete it if there are none.
# - {type: distance, points: [p1, p2], value: 2.0005, sigma: 0.0002}
# - {type: vertical_plane, points: [p1, p2, p3], sigma: 0.001}
[]
""",
}


def block_templates(folder: Path, images: str = "digital") -> dict[Path, str]:
    """The files of a block folder, by path.

    Parameters
    ----------
    images : {'digital', 'film', 'reduced'}
        What was measured; fiducials.csv is there for film alone.
    """
    settings = BLOCK_YAML.replace("@CAMERA@", CAMERAS[images] + _LENS).replace(
        "@C@", "50.0 " if images == "digital" else "153.0"
    )
    tables = {name: text for name, text in TABLES.items() if name != "fiducials.csv" or images == "film"}
    return {folder / "block.yaml": settings} | {folder / name: text for name, text in tables.items()}


def sample_folder() -> Path:
    """The block of the tutorial: beside the code in a wheel, in docs of a checkout."""
    package = Path(__file__).resolve().parents[1]
    return installed_path(package / "pipeline" / "sample", package.parent / "docs" / "tutorial")


def demo_path() -> Path:
    """The demo pipeline: beside the code in a wheel, at the top of a checkout."""
    package = Path(__file__).resolve().parents[1]
    return installed_path(package / "pipeline" / "demo.yaml", package.parent / "pipeline.yaml")


def installed_path(packed: Path, beside: Path) -> Path:
    """What an installation has beside its code, or a checkout elsewhere.

    Raises
    ------
    ResourceError
        If it is at neither place.
    """
    if not packed.exists() and not beside.exists():
        what = f"is not there, nor is {beside}"
        raise ResourceError(what, where=str(packed), remedy="install aatri again, or restore the file")
    return packed if packed.exists() else beside
