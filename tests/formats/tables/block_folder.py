"""A small block folder with a bit of everything, for the tests of reading and writing."""

from __future__ import annotations

from pathlib import Path

FILES = {
    "block.yaml": """\
aatri_block: 1
name: bit of everything
frames:
  map: {axes: [north, east, up], crs: EPSG:32650}
earth_curvature: correct
units: {ground: m, angle: gon, sigma_image: um, sigma_ground: cm, sigma_angle: mgon, time: s}
rotation: phi-omega-kappa
sigma: {image: 5, fiducial: 2, control: [2, 3, 4], position: [10, 10, 20], attitude: [5, 5, 10]}
terrain_height: 6.1
cameras:
  007:
    kind: film
    image_coordinates: comparator
    format: [230, 230]
    principal_distance: 153.84
    principal_point: [0.011, 0.002]
    fiducials: {1: [106.002, -106.003], 2: [-106.001, -106.004], 3: [-106.0, 106.002], 4: [105.999, 106.002]}
    distortion: {model: table, radius: [0, 50, 100], correction: [0, 1.1, -2.3]}
    x_serial: 4711
  uav:
    kind: digital
    image_coordinates: pixel
    pixel: {size: 0.0033, origin: top-left-corner, y: down}
    format: [6000, 4000]
    principal_distance: 24.01
    distortion: {model: brown, k1: 1e-5, k2: -3.1e-8, p1: 1e-6}
    sigmas: {principal_distance: .inf, principal_point: [0.01, 0.01], k1: 1e-7, k2: 0}
    lever_arm: [0.1, 0.0, -0.3]
    boresight: [0.1, 0.0, -0.05]
""",
    "images.csv": """\
# two film images and two digital ones
image,camera,strip,sequence,time,session,x_note
a2,007,s1,2,20.5,day 1,cloud
a1,007,s1,1,10.5,day 1,
"d,1",uav,,,,,
d2,uav,,,,,
""",
    "image_points.csv": """\
point,image,x,y,sx,sy,group,active
1,a1,10.5,20.25,,,,
2,a1,-30.1,40.2,4,4,,
3,a1,50,-60,,,weak,
0123,a1,55,61,,,,
1,a2,-9.5,20.25,,,,
2,a2,-50.1,40.2,,,,
2,a2,-50.102,40.201,,,,
3,a2,30,-60,,,,
0123,a2,35,61,,,,no
1,"d,1",100,200,,,,
2,"d,1",3000,2000,,,,
3,"d,1",5900,3900,,,,
K,"d,1",700,900,,,,
1,d2,110,210,,,,
2,d2,3010,2000,,,,
3,d2,5910,3910,,,,
""",
    "fiducials.csv": """\
image,fiducial,x,y,sx
a1,1,216.1,4.2,
a1,2,4.1,4.3,3
a1,3,4.1,216.2,
a1,4,216.0,216.3,
a2,1,216.1,4.2,
a2,2,4.1,4.3,
a2,3,4.1,216.2,
a2,4,216.0,216.3,
""",
    "ground_points.csv": """\
point,X,Y,Z,sX,sY,sZ,sXY,role,datum
K,4505079.577,446263.976,6.378,0,0,0,,,yes
1,4505179.577,446363.976,7.378,1,2,3,0.5,XY:control Z:check,
2,4505279.577,446463.976,,,,,,,
3,4505279.577,446563.976,8.1,,,,,check,
0123,,,9.5,,,,,approximate,
""",
    "exterior.csv": """\
image,X,Y,Z,sX,sY,sZ,a1,a2,a3,s1,s2,s3,use,refers_to,drift_group
a1,4505079.5,446263.9,385.1,5,5,8,,,,,,,,antenna,g1
a2,4505179.5,446263.9,385.2,,,,0.1,0.2,-399.9,,,,,,
"d,1",,,,,,,1,2,3,4,4,6,,,
d2,4505179.5,446463.9,385.2,,,,1,2,3,,,,observed,,
""",
    "geodetic.csv": """\
type,from,to,value,sigma,via,set,h_from,reduced,to_kind
distance,1,2,141.42,0.003,,,1.5,map,
angle,1,2,100.5,0.0003,K,,,,
direction,K,3,12.5,0.0003,,s1,,,
dX,K,1,100.001,0.002,,,,,
dY,K,1,100.002,0.002,,,,,
height_difference,K,a1,378.7,0.01,,,,,image
distance,3,3,5,0.003,,,,,
""",
    "covariances.csv": "table,row_a,row_b,value\ngeodetic,4,5,1e-6\n",
    "relative_control.yaml": """\
- {type: vertical_plane, points: ["1", "2", "3"], sigma: 0.001}
- {type: distance, points: [K, 0123], value: 200.05, sigma: 0.0002}
- {type: coordinate_difference, points: [K, 1], axis: X, value: 100.0, exact: true}
- {type: angle, at: K, between: [1, 2], value: 50, sigma: 0.001}
- {type: parallel, pairs: [[K, 1], [2, 3]], exact: true}
- {type: sphere, points: [K, 1, 2, 3], radius: 1000, sigma: 0.01}
""",
}
"""Name -> text. All 4 images have at least 3 points."""


def write_folder(folder: Path, changes: dict[str, str | bytes | None] | None = None) -> Path:
    """Write the folder with some files replaced, or left out where None."""
    folder.mkdir(exist_ok=True)
    for name, text in {**FILES, **(changes or {})}.items():
        if isinstance(text, str):
            (folder / name).write_bytes(text.encode())
        elif text is not None:
            (folder / name).write_bytes(text)
    return folder


def replaced(name: str, old: str, new: str) -> dict[str, str | bytes | None]:
    """The change of one file in which `old` stands for `new`."""
    assert FILES[name].count(old) >= 1
    return {name: FILES[name].replace(old, new, 1)}
