"""The three oblique strips of rashidyreza/Strip-Adjustment-with-Matlab as a block folder, without strips and order."""

from __future__ import annotations

from pathlib import Path

CAMERA = """\
aatri_block: 1
name: uav_3strips
frames: {utm: {axes: [east, north, up], crs: local}}
earth_curvature: ignore
units: {ground: m, angle: deg, sigma_image: um, sigma_ground: m, sigma_angle: deg, time: s}
rotation: omega-phi-kappa
sigma: {image: 1.0, control: [0.03, 0.03, 0.03]}
cameras:
  FC300X:
    kind: digital
    image_coordinates: photo
    format: [4000, 3000]
    pixel: {size: 0.00156192, origin: top-left-corner, y: down}
    principal_distance: 3.62383
    principal_point: [0.00222, 0.01883]
    distortion: {model: brown, k1: 8.654e-4, k2: -8.593e-5}
"""
TIES = {
    "Tie_points_for_AO.txt": "T",
    "Matching.txt": "M1-",
    "MatchingB2.txt": "M2-",
    "MatchingB3.txt": "M3-",
    "GCP_ImageCs.txt": "G",
}


def block_folder(data: Path, folder: Path) -> Path:
    """Write the block: image points as measured, control as the README of the data splits it."""
    folder.mkdir(parents=True)
    (folder / "block.yaml").write_text(CAMERA, encoding="utf-8")
    points = ["image,point,x,y"]
    images = set()
    for name, head in TIES.items():
        for line in (data / name).read_text(encoding="utf-8").splitlines():
            cells = line.split()
            if len(cells) >= 4 and cells[0].endswith(".JPG"):
                images.add(cells[0])
                points.append(f"{cells[0]},{head}{cells[1]},{cells[2]},{cells[3]}")
    (folder / "image_points.csv").write_text("\n".join([*points, ""]), encoding="utf-8")
    (folder / "images.csv").write_text(
        "\n".join(["image,camera", *(f"{i},FC300X" for i in sorted(images)), ""]), encoding="utf-8"
    )
    control = ["point,X,Y,Z,role"]
    measured = {line.split(",")[1] for line in points}
    rows = [line.split() for line in (data / "GCP_UTM.txt").read_text(encoding="utf-8").splitlines() if line.split()]
    rows = sorted((row for row in rows if f"G{row[0]}" in measured), key=lambda row: int(row[0]))
    for k, row in enumerate(rows):
        control.append(f"G{row[0]},{row[1]},{row[2]},{row[3]},{'check' if k % 3 == 1 else 'control'}")
    (folder / "ground_points.csv").write_text("\n".join([*control, ""]), encoding="utf-8")
    return folder
