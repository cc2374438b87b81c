"""Control points by forward intersection, as observations of the bundle: against the formulas of the close-range notes.

    X_P = [X_A cot b + X_B cot a + (Y_B - Y_A)] / (cot a + cot b),   Y_P = [Y_A cot b + Y_B cot a - (X_B - X_A)] / (...)
    Z_P = 1/2 [(Z_A + i_A + d_A tan v_A - t) + (Z_B + i_B + d_B tan v_B - t)]
    M_P^2 = m_a^2 (d_A^2 + d_B^2) / sin^2 gamma + (d_B M_A / S)^2 + (d_A M_B / S)^2                             (5-2-8)
    m_h^2 = (d m_v / cos^2 v)^2 + (tan v m_d)^2                                                                 (5-2-9)
    lambda = L / |MN|,   S' = lambda S,   X' = lambda X                                               (5-2-10, 5-2-11)

valid as printed for P to the right of A -> B, X east and Y north (erratum E17).
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from aatri.arrays import Float
from aatri.artifacts.solution import Solution
from aatri.errors import GeometryError
from aatri.plugin import SILENT, Context
from aatri.stages.block.tables import TablesOptions, tables
from aatri.stages.bundle_adjustment.bundle import BundleOptions, bundle
from tests.stages.bundle_adjustment.test_networks import HEAD
from tests.stages.film_blocks import Told

I_A, I_B, TARGET = 1.552, 1.498, 0.25
SECOND = np.radians(1 / 3600)


def notes_plan(A: Float, B: Float, alpha: float, beta: float) -> Float:
    """Of the notes as printed; P to the right of A -> B."""
    cot_a, cot_b = 1 / np.tan(alpha), 1 / np.tan(beta)
    x = (A[0] * cot_b + B[0] * cot_a + (B[1] - A[1])) / (cot_a + cot_b)
    y = (A[1] * cot_b + B[1] * cot_a - (B[0] - A[0])) / (cot_a + cot_b)
    return np.array([x, y])


def sighted(P: Float, A: Float, B: Float) -> tuple[float, float, float, float]:
    """Angles at A and B between the base and P, and the zenith angles, of east, north, up."""
    base, a, b = B - A, P - A, P - B
    alpha = float(np.arccos(a[:2] @ base[:2] / np.linalg.norm(a[:2]) / np.linalg.norm(base[:2])))
    beta = float(np.arccos(-b[:2] @ base[:2] / np.linalg.norm(b[:2]) / np.linalg.norm(base[:2])))
    zenith = [float(np.arctan2(np.linalg.norm(u[:2]), u[2] + TARGET - i)) for u, i in ((a, I_A), (b, I_B))]
    return alpha, beta, zenith[0], zenith[1]


def adjusted(folder: Path, ground: list[str], sights: list[str], context: Context = SILENT) -> Solution:
    (folder / "block.yaml").write_text(HEAD)
    new = dict.fromkeys(sight.split(",")[2] for sight in sights if sight.startswith("zenith"))
    ground = [*ground, *(f"{name},,,,,,," for name in new)]
    (folder / "ground_points.csv").write_text("\n".join(["point,X,Y,Z,sX,sY,sZ,role", *ground]) + "\n")
    (folder / "geodetic.csv").write_text("\n".join(["type,from,to,via,value,sigma,h_from,h_to", *sights]) + "\n")
    block = tables(options=TablesOptions(path=folder))
    options = BundleOptions.model_validate({"blunders": "none", "tolerance": 1e-9})
    return bundle(block, options=options, context=context)


def sights_of(name: str, seen: tuple[float, float, float, float], sigma_s: tuple[float, float]) -> list[str]:
    alpha, beta, z_A, z_B = np.degrees(seen).tolist()
    angle, zenith = (s / 3600 for s in sigma_s)
    return [  # clockwise from -> to: P lies to the right of A -> B
        f"angle,B,{name},A,{alpha!r},{angle!r},,",
        f"angle,{name},A,B,{beta!r},{angle!r},,",
        f"zenith,A,{name},,{z_A!r},{zenith!r},{I_A},{TARGET}",
        f"zenith,B,{name},,{z_B!r},{zenith!r},{I_B},{TARGET}",
    ]


A, B, P = np.array([0.0, 0.0, 10.0]), np.array([0.0, 8.0, 10.2]), np.array([6.1, 3.7, 12.4])


def test_a_point_its_height_and_their_accuracy_are_those_of_the_notes(tmp_path: Path) -> None:
    """A the origin, the base along the north; stations known to 0.3 and 0.5 mm a coordinate in plan, angles to 2"."""
    m_A, m_B, sigma = 3e-4, 5e-4, 2.0
    seen = sighted(P, A, B)
    ground = [f"{n},{x},{y},{z},{m},{m},1e-7,control" for n, (x, y, z), m in (("A", A, m_A), ("B", B, m_B))]
    # heights of half a degree tell nothing of the plan, which the formula knows nothing of
    solution = adjusted(tmp_path, ground, sights_of("P", seen, (sigma, 2000.0)))
    k = solution.points.id.tolist().index("P")
    xyz, C = solution.points.xyz_m[k], solution.points.covariance_m2[k]
    special = 8.0 / (1 / np.tan(seen[0]) + 1 / np.tan(seen[1]))  # of the notes' frame: S / (cot a + cot b), east
    np.testing.assert_allclose(xyz[:2], [special, special / np.tan(seen[0])], atol=1e-9)
    np.testing.assert_allclose(xyz[:2], notes_plan(A, B, seen[0], seen[1]), atol=1e-9)
    d_A, d_B = np.linalg.norm((P - A)[:2]), np.linalg.norm((P - B)[:2])
    heights = A[2] + I_A + d_A / np.tan(seen[2]) - TARGET, B[2] + I_B + d_B / np.tan(seen[3]) - TARGET
    assert xyz[2] == pytest.approx(np.mean(heights), abs=1e-9)
    gamma = np.pi - seen[0] - seen[1]
    plan = (sigma * SECOND) ** 2 * (d_A**2 + d_B**2) / np.sin(gamma) ** 2
    plan += 2 * (d_B * m_A / 8.0) ** 2 + 2 * (d_A * m_B / 8.0) ** 2
    assert np.trace(C[:2, :2]) == pytest.approx(plan, rel=1e-6)


def test_the_accuracy_of_a_height_is_that_of_the_notes_for_two_equal_sights(tmp_path: Path) -> None:
    """Halfway between exact stations: the mean of both, sigma of one over the root of two; distances have no error."""
    P = np.array([6.0, 4.0, 12.4])
    seen = sighted(P, A, np.array([0.0, 8.0, 10.0 + I_A - I_B]))
    ground = ["A,0,0,10,0,0,0,control", f"B,0,8,{10.0 + I_A - I_B},0,0,0,control"]
    solution = adjusted(tmp_path, ground, sights_of("P", seen, (1e-4, 3.0)))
    k = solution.points.id.tolist().index("P")
    d, v = np.linalg.norm((P - A)[:2]), np.pi / 2 - seen[2]
    expected = d * 3.0 * SECOND / np.cos(v) ** 2 / np.sqrt(2)
    assert np.sqrt(solution.points.covariance_m2[k, 2, 2]) == pytest.approx(expected, rel=1e-6)


def test_a_bar_gives_the_scale_of_a_net_of_angles_alone(tmp_path: Path) -> None:
    """The base is known to a centimetre; the bar M-N of 3 m brings lambda = L / |MN| to every point and to the base."""
    points = {"M": np.array([5.0, 2.0, 11.0]), "N": np.array([6.8, 4.4, 11.0]), "P": P}
    ground = ["A,0,0,10,0,0,0,control", "B,0,8.01,10.2,0,,0,XZ:control Y:approximate"]  # north of A, about 8 m
    sights = [row for name, X in points.items() for row in sights_of(name, sighted(X, A, B), (2.0, 3.0))]
    sights.append("horizontal_distance,M,N,,3.0,0.00001,,")
    solution = adjusted(tmp_path, ground, sights)
    at = {name: solution.points.xyz_m[k] for k, name in enumerate(solution.points.id.tolist())}
    rough = 8.01  # what a tape says
    local = {n: notes_plan(A, np.array([0.0, rough]), *sighted(X, A, B)[:2]) for n, X in points.items()}
    scale = 3.0 / np.linalg.norm(local["M"] - local["N"])
    assert at["B"][1] == pytest.approx(scale * rough, abs=1e-8)
    for name in points:
        np.testing.assert_allclose(at[name][:2], scale * local[name], atol=1e-8)
        np.testing.assert_allclose(at[name], points[name], atol=1e-7)


def test_parallel_rays_are_refused_by_name(tmp_path: Path) -> None:
    """alpha + beta = 180 degrees: the rays never meet, and the others go on."""
    ground = ["A,0,0,10,0,0,0,control", "B,0,8,10.2,0,0,0,control"]
    parallel = sights_of("Q", (np.radians(80.0), np.radians(100.0), 1.5, 1.5), (2.0, 3.0))
    told = Told()
    solution = adjusted(tmp_path, ground, [*sights_of("P", sighted(P, A, B), (2.0, 3.0)), *parallel], told)
    assert any("their rays are parallel" in w and w.endswith(": Q") for w in told.warnings)
    assert np.isfinite(solution.points.xyz_m).all(axis=1).tolist() == [True, True, True, False]
    alone = Told()
    with pytest.raises(GeometryError, match="nothing to adjust"):
        adjusted(tmp_path, ground, parallel, alone)
    assert any("their rays are parallel" in w for w in alone.warnings)


def test_observations_computed_from_coordinates_are_called_so(tmp_path: Path) -> None:
    """Their residuals are 0, which no factor of their standard deviations explains."""
    ground, told = ["A,0,0,10,0,0,0,control", "B,0,8,10.2,0,0,0,control"], Told()
    points = {"P": P, "Q": np.array([7.1, 5.7, 12.9]), "R": np.array([8.1, 2.7, 12.6])}
    sights = [row for name, X in points.items() for row in sights_of(name, sighted(X, A, B), (2.0, 3.0))]
    adjusted(tmp_path, ground, sights, told)
    (text,) = [w for w in told.warnings if w.startswith("zenith")]
    assert text.startswith("zenith: residuals of these 6 observations are 0 (redundancy 3); were they computed")
