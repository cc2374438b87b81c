"""The principal distance and the flying height through the bundle: the table of designs, and the advice it gives.

Eight designs of four strips of eight images (tests/camera/parameters/test_coupling_with_height.py) with the largest
correlation of c with a Z0 that the reference has. Its relief and points are others: figures are held against dense
algebra over the same block, and against the reference by what has to be told: a warning from 0.95 on, "cannot be told
apart" from 0.999 on.
"""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from aatri.stages.bundle_adjustment.bundle import BundleOptions, bundle
from tests.camera.parameters.test_coupling_with_height import C_MM, HALF, NEARLY_FLAT, flight, largest, points_of
from tests.small_blocks import adjusted_by, measure
from tests.small_blocks import flown as small_block
from tests.stages.chain import run_chain, simulated
from tests.stages.film_blocks import Told
from tests.stages.hand_block import Hand, ground_rows, projected, read, start

ADVICE = (
    "observed projection centres (GNSS) or oblique images separate them, crossed strips and a second flying height do "
    "not, relief alone only above 20 % of the flying height"
)
TABLE = [
    ("vertical", NEARLY_FLAT, 0.999998),
    ("crossed", NEARLY_FLAT, 0.999999),
    ("oblique", NEARLY_FLAT, 0.971),
    ("gnss", NEARLY_FLAT, 0.16),
    ("vertical", 0.05, 0.9996),
    ("vertical", 0.10, 0.998),
    ("vertical", 0.20, 0.997),
    ("oblique", 0.20, 0.836),
]
"""Design, relief over flying height, reference correlation; the reference's 0 % is 1 % here, or c were free."""


def flown(design: str, relief: float) -> Hand:
    (X0, R), X = flight(design), points_of(relief)
    image, point = (a.ravel() for a in np.indices((len(X0), len(X))))
    xy = projected(X0, R, X, image, point)
    u = np.einsum("nji,nj->ni", R[image], X[point] - X0[image])
    inside = (np.abs(xy) <= HALF).all(axis=1) & (u[:, 2] < 0)
    inside &= (np.bincount(point[inside], minlength=len(X)) >= 2)[point]
    kept, place = np.unique(np.concatenate([np.arange(9), point[inside]]), return_inverse=True)
    return Hand(X0, R, X[kept], image[inside], place[9:], xy[inside])


@pytest.mark.slow
@pytest.mark.parametrize(("design", "relief", "reference"), TABLE)
def test_sigma_correlation_and_advice(tmp_path: Path, design: str, relief: float, reference: float) -> None:
    of = flown(design, relief)
    rows = [f"i{k},{x!r},{y!r},{z!r},0.05,0.05,0.05" for k, (x, y, z) in enumerate(of.position_m.tolist())]
    exterior = "\n".join(["image,X,Y,Z,sX,sY,sZ", *rows]) + "\n" if design == "gnss" else ""
    camera = {"principal_distance": C_MM, "principal_point": [0.0, 0.0], "format": (2 * HALF).tolist()}
    more = {"sigma": {"image": 3, "control": [0.02, 0.02, 0.02]}}
    block, points = read(
        tmp_path,
        of,
        ground=ground_rows(of, range(9)),
        exterior=exterior,
        camera=camera,
        more=more,
        xy_mm=of.xy_mm - np.array([0.02, -0.01]),
    )
    wanted = {"set": "brown_conrady", "per": {"camera": ["c", "x0", "y0", "k1", "k2"]}, "sigma_um": None}
    options = BundleOptions.model_validate({"blunders": "none", "self_calibration": wanted})
    image, point = (np.array([int(name[1:]) for name in ids]) for ids in (block.images.id, block.points.id))
    as_read = replace(of, position_m=of.position_m[image], rotation=of.rotation[image], xyz_m=of.xyz_m[point])
    told = Told()
    solution = bundle(block, points, start(as_read, block), options=options, context=told)
    _, rho, sigma_mm = largest(design, relief)
    c = solution.parameters.sigma[solution.parameters.name == "c"][0]
    assert c == pytest.approx(sigma_mm, rel=0.01)
    mine = [text for text in told.warnings if re.search(r"c and Z0 of image \S+ (are correlated|cannot be told)", text)]
    assert bool(mine) == (reference >= 0.95)
    for text in mine:
        found = abs(float(re.search(r"correlat\w+(?: by|) (-?[\d.]+\d)", text)[1]))  # type: ignore[index]
        assert found == pytest.approx(abs(rho), abs=0.01)
        assert ("cannot be told apart" in text) == (found >= 0.999)
        assert ADVICE in text
    if reference >= 0.9995:
        assert any("cannot be told apart" in text for text in mine)


@pytest.mark.slow(after=1)
@pytest.mark.parametrize("seed", [1, 2])
def test_the_errors_of_the_coordinates_do_not_pass_for_another_principal_distance(seed: int) -> None:
    """Flat ground and control: c is known to 0.4 %, and 4.5 % more would make all image coordinates' errors smaller."""
    block = simulated(
        seed,
        camera={
            "kind": "digital",
            "principal_distance_mm": 9.0,
            "format": (4000.0, 3000.0),
            "pixel_size_mm": 0.0027,
            "margin_mm": 0.1,
        },
        flight={"strips": 4, "images_per_strip": 5, "side_overlap": 60.0, "scale_number": 12000.0},
        terrain={"mean_height_m": 0.0, "relief_m": 5.0, "wavelength_m": 300.0},
        ties={"per_position": 5},
        known={"full": 8},
        noise={"image_um": 2.0},
    )
    set_ = BundleOptions(self_calibration={"set": "brown_conrady"}, positions={"use": False})
    solution = run_chain(block, set_).bundle
    p = solution.parameters.take(solution.parameters.name == "c")
    assert abs(p.value[0]) < 4 * p.sigma[0]
    assert p.sigma[0] < 0.1


@pytest.mark.slow
@pytest.mark.parametrize(("way", "up_m"), [("chain", 3.0), ("graph", 3.0), ("graph", 2.0)])
def test_positions_on_another_height_beside_a_weighted_principal_distance_change_no_weight_of_control(
    tmp_path: Path, way: str, up_m: float
) -> None:
    """The c that is given would give way by 14 of its standard deviations; four control points have little to say.

    By 2 m heights are 0.7 m off, 3.3 of their standard deviations: by chance one parameter moves them by 2.6 at most.
    """
    small = small_block(strips=2, per_strip=4, apart_m=400.0, points=30)
    small.camera["sigmas"] = {"principal_distance": 0.02}
    small.position_m = {i: x + np.array([0.0, 0.0, 500.0]) for i, x in small.position_m.items()}
    measure(small, np.random.default_rng(1), 2.0)
    small.rays = {key: xy for key, xy in small.rays.items() if (np.abs(xy) < (45.0, 32.0)).all()}
    small.position_m = {i: x + np.array([0.0, 0.0, up_m]) for i, x in small.position_m.items()}
    head = small.write(tmp_path / "block") / "block.yaml"
    head.write_text(head.read_text().replace("image: 3.0", "image: 6.0"))
    done = adjusted_by(way, tmp_path / "block")
    assert done.bundle.contradictions == 1
    what = "heights of positions and control count from different surfaces" if up_m > 2 else "ask for a principal dist"
    assert any(text.startswith("the result contradicts") and what in text for text in done.warnings)
    assert not [text for text in done.warnings if "standard deviations do not fit" in text]
