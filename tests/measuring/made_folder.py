"""A block folder with pictures made up for tests: crosses at known places, drawn by other code than aatri's."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from tests.made_scans import stroke

WIDTH, HEIGHT = 700, 500
BLUR_PX = 1.0
"""Of lens and sampling."""
CROSSES = {"a": (301.37, 222.81), "b": (150.2, 330.9)}
"""Centre of the cross of each image, px from the outer corner of the first pixel."""
BLOCK = """\
aatri_block: 1
name: made up
frames: {map: {axes: [east, north, up], crs: local}}
units: {ground: m, angle: deg, sigma_image: px, sigma_ground: m, sigma_angle: deg, time: s}
sigma: {image: 0.5, control: [0.02, 0.02, 0.02]}
cameras:
  c: {kind: digital, image_coordinates: pixel, pixel: {size: 0.01, origin: ORIGIN, y: Y}, format: [700, 500],
      principal_distance: 7.0}
"""


def made_folder(folder: Path, origin: str = "top-left-corner", y: str = "down") -> Path:
    """Images a and b with a cross each, c without a file; control G1, check point G2."""
    cv2 = pytest.importorskip("cv2", reason="works on images need the extra `images`")
    folder.mkdir(parents=True, exist_ok=True)
    rng = np.random.default_rng(5)
    for name, centre in CROSSES.items():
        picture = np.full((HEIGHT, WIDTH), 60.0) + rng.normal(0, 2.0, (HEIGHT, WIDTH))
        first = np.floor(np.array(centre)).astype(int) - 30
        window = picture[first[1] : first[1] + 61, first[0] : first[0] + 61]
        window += 120 * gaussian_filter(
            stroke(61, np.array(centre) - 0.5 - first, 0.0, length=30.0, width=4.0), BLUR_PX
        )
        cv2.imwrite(str(folder / f"{name}.png"), np.clip(picture.round(), 0, 255).astype(np.uint8))
    (folder / "block.yaml").write_text(BLOCK.replace("ORIGIN", origin).replace("Y}", f"{y}}}"))
    (folder / "images.csv").write_text("image,camera,path\na,c,a.png\nb,c,b.png\nc,c,gone.png\nd,c,\n")
    (folder / "ground_points.csv").write_text("point,X,Y,Z,role\nG1,0,0,0,control\nG2,10,0,0,check\n")
    return folder
