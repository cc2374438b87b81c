"""Every writer: what it writes, read by our own reader, is the same block.

The block is made here, its rays by the collinearity equations and the distortion's formula written out again; cameras,
poses, points and image points of each format are compared with it in pixels, control by names, roles and sigmas.
"""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

from aatri.artifacts.block import Block, Frames
from aatri.artifacts.builder import block_of
from aatri.codes import APPROXIMATE, CHECK, CONTROL
from aatri.errors import AatriError
from aatri.formats.lists.list_columns import PRESETS
from aatri.formats.parts.assembled import assembled
from aatri.formats.parts.block_parts import LOCAL
from aatri.formats.parts.format import Format, Reading, Writing
from aatri.formats.parts.of_block import parts_of
from aatri.formats.parts.one_frame import topocentric
from aatri.formats.registry.catalogue import FORMATS
from aatri.formats.registry.export import write_as
from aatri.formats.registry.settings import settings_of
from aatri.formats.registry.sources import read_all, read_source
from aatri.formats.results.oriented_block import OrientedBlock
from aatri.frames.conversion import Frame
from aatri.geometry.rotations import rotation_from_angles
from aatri.progress import SILENT
from tests.formats.lens_projection import misfit_px
from tests.formats.told import Told

SIZE, F_PX, POINT_PX, PIXEL_MM = np.array([4000.0, 3000.0]), 3500.0, np.array([12.5, -7.25]), 0.004
FULL = {"k1": -0.05, "k2": 0.02, "p1": 1e-3, "p2": -5e-4, "k3": -0.004}
IMAGES = ("1001", "1002", "1003", "1004")


class Case(NamedTuple):
    """A format: the distortion that it can state exactly, what the poses are written to, and whether ids stay."""

    distortion: dict[str, float] = FULL
    px: float = 1e-9
    position_m: float = 1e-9
    image_ids: bool = True
    point_ids: bool = True
    frame: Frame = LOCAL


MIDDLE = [500_000.0, 5_000_000.0, 0.0]
UTM = Frame("utm", ("east", "north", "up"), "EPSG:32632")
CASES = {
    "bal": Case({"k1": -0.05, "k2": 0.02}, image_ids=False, point_ids=False),
    "bingo": Case(),
    "blocksexchange": Case(point_ids=False),
    "colmap": Case(point_ids=False),
    "metashape": Case(),
    "metashape in a map": Case(px=1e-6, position_m=5e-9, frame=UTM),
    "micmac": Case(),
    "nvm": Case({}, point_ids=False),
    "opensfm": Case(frame=topocentric(45.0, 9.0, 200.0), position_m=5e-9),
    "opf": Case(),
    "opf in a map": Case(px=1e-8, position_m=5e-9, frame=UTM),
    "patb": Case(px=1e-3, position_m=1e-5),  # F16.5: half of 1e-5 m at 500 m, 3500 px
    "table": Case(),
    "tables": Case(),
}
HAVE_POINTS = {"control", "start values of points"}


def made_block(distortion: dict[str, float], frame: Frame = LOCAL) -> Block:
    """Four images over 5 x 4 points, with exact rays; control, check points, ties."""
    column, row = np.meshgrid(np.arange(5.0), np.arange(4.0), indexing="ij")
    xyz = np.stack(
        [80 * column.ravel() + 10, 90 * row.ravel() - 5, 7 * np.sin(column.ravel() * 3 + row.ravel())], axis=1
    )
    points = [f"P{k}" for k in range(len(xyz))]
    position = np.array([[60.0 + 90 * k, 120.0 + 20 * (k % 2), 500.0 + k] for k in range(len(IMAGES))])
    angles = np.radians([[2.0 * k - 3, 1.5 - k, 90.0 * (k % 2) + k] for k in range(len(IMAGES))])
    R = rotation_from_angles(angles)
    if frame == UTM:
        xyz, position = np.add(xyz, MIDDLE), np.add(position, MIDDLE)
    role = np.array([CONTROL] * 5 + [CHECK] * 2 + [APPROXIMATE] * (len(xyz) - 7))
    rows = [(i, p) for i in range(len(IMAGES)) for p in range(len(xyz))]
    xy = np.array([seen_px(xyz[p], position[i], R[i], distortion) for i, p in rows])
    inside = (np.abs(xy) < SIZE / 2).all(axis=1)
    rows, xy = [row for row, there in zip(rows, inside) if there], xy[inside]
    cameras = {
        "id": ["cam"],
        "pixel_size_mm": PIXEL_MM,
        "pixel_origin": "top-left-corner",
        "pixel_y": "down",
        "format": SIZE[None],
        "principal_distance_mm": F_PX * PIXEL_MM,
        "principal_point_mm": POINT_PX[None] * PIXEL_MM * [1, -1],
        "distortion": "opencv" if distortion else "none",
    }
    frames = Frames.of(id="f", axes=",".join(frame.axes), crs=frame.crs, vertical="")
    of_frame: dict[str, Any] = {} if frame == LOCAL else {"frames": frames}
    return block_of(
        name="made",
        cameras=cameras,
        camera_parameters={"camera": "cam", "name": list(distortion), "value": list(distortion.values())}
        if distortion
        else None,
        images={"id": IMAGES, "camera": "cam", "sequence": np.arange(4.0)},
        image_points={
            "image": [IMAGES[i] for i, _ in rows],
            "point": [points[p] for _, p in rows],
            "xy": xy + SIZE / 2,
            "sigma_mm": 0.002,
        },
        ground_points={
            "point": points,
            "xyz_m": xyz,
            "sigma_m": np.where(role[:, None] == APPROXIMATE, 0.0, [0.02, 0.02, 0.03]),
            "role": np.broadcast_to(role[:, None], xyz.shape),
        },
        exterior={"image": IMAGES, "position_m": position, "angles_rad": angles},
        **of_frame,
    )


def seen_px(xyz: Any, position: Any, R: Any, distortion: dict[str, float]) -> np.ndarray:
    """Image coordinates from the image centre, y down: collinearity and the formula of OpenCV."""
    a, b, c = np.asarray(R).T @ (np.asarray(xyz) - position)
    u, v = a / -c, b / c
    k1, k2, p1, p2, k3 = (distortion.get(name, 0.0) for name in ("k1", "k2", "p1", "p2", "k3"))
    q = u * u + v * v
    gain = 1 + q * (k1 + q * (k2 + q * k3))
    x = u * gain + 2 * p1 * u * v + p2 * (q + 2 * u * u)
    y = v * gain + p1 * (q + 2 * v * v) + 2 * p2 * u * v
    return np.array([x, y]) * F_PX + POINT_PX


def joined(block: Block, folder: Path, declared: Format, frame: Frame) -> Block:
    """What was read, with cameras, image points and orientations of the made block where the format has none."""
    parts = read_all([folder], settings_of(["maps=ground_from_image"]), SILENT)[1]
    rest = parts_of(block, "made")
    rest.files = [Path("made")]
    rest.frame, rest.ground_points = None, rest.ground_points if not {*declared.written} & HAVE_POINTS else {}
    if "cameras" in declared.written:
        rest.cameras, rest.camera_parameters, rest.images = {}, {}, {}
    marked = {str(p) for of in parts for p in of.image_points.get("point", ())}
    own = ~np.isin(rest.image_points["point"], sorted(marked)) & ("image points" not in declared.written)
    rest.image_points = {n: v[own] for n, v in rest.image_points.items()} if own.any() else {}
    if "start orientations" in declared.written:
        rest.exterior = {}
    sources = [*parts, rest] if "image points" in declared.written else [rest, *parts]
    return assembled(sources, frame=None if frame == LOCAL else frame)


@pytest.mark.parametrize("name", CASES)
def test_what_is_written_is_read_back_as_the_same_block(tmp_path: Path, name: str) -> None:
    declared, case = next(f for f in FORMATS if f.name == name.split()[0]), CASES[name]
    if not declared.read:
        pytest.skip(f"{name} is written and not read")
    block = made_block(case.distortion, case.frame)
    write_as(declared, OrientedBlock(block), tmp_path / "out", Writing(), SILENT)
    again = joined(block, tmp_path / "out", declared, case.frame)
    assert len(again.image_points) == len(block.image_points)
    xyz_m = dict(zip(block.points.id[block.ground_points.point].tolist(), block.ground_points.xyz_m))
    for image in again.images.id.tolist() if case.image_ids else ():
        k, of = again.images.id.tolist().index(image), block.images.id.tolist().index(image)
        np.testing.assert_allclose(again.exterior.position_m[k], block.exterior.position_m[of], atol=case.position_m)
    given = dict(zip(again.points.id[again.ground_points.point].tolist(), again.ground_points.xyz_m))
    for k, image in enumerate(again.images.id.tolist()):
        rows = again.image_points.image == k
        names = again.points.id[again.image_points.point[rows]].tolist()
        seen = [xyz_m[n] if case.point_ids else given[n] for n in names]
        assert misfit_px(with_pixels(again), image, again.image_points.xy[rows], seen).max() < case.px
    if "control" in declared.written:
        check_control(block, again, declared, case.position_m)


def with_pixels(block: Block) -> Block:
    """Photo coordinates of cameras without pixels, counted in those of the made camera."""
    return replace(
        block,
        cameras=replace(
            block.cameras,
            pixel_size_mm=np.where(np.isnan(block.cameras.pixel_size_mm), PIXEL_MM, block.cameras.pixel_size_mm),
        ),
    )


def check_control(block: Block, again: Block, declared: Format, within_m: float) -> None:
    """Names, coordinates, sigmas, and roles as far as the format has them."""
    first, second = (
        {str(b.points.id[p]): k for k, p in enumerate(b.ground_points.point.tolist())} for b in (block, again)
    )
    g, a = block.ground_points, again.ground_points
    roles = [CONTROL] + [CHECK] * ("check points" in declared.written)
    for name in [name for name, k in first.items() if g.role[k][0] in roles]:
        k, j = first[name], second[name]
        assert a.role[j].tolist() == g.role[k].tolist()
        np.testing.assert_allclose(a.xyz_m[j], g.xyz_m[k], atol=within_m)
        if "standard deviations" in declared.written:
            np.testing.assert_allclose(a.covariance_m2[j], g.covariance_m2[k], rtol=1e-12)
    assert not [name for name, j in second.items() if a.role[j][0] == CONTROL and g.role[first[name]][0] != CONTROL]


def test_every_format_that_is_written_has_its_case() -> None:
    """WuCAPS takes photo coordinates alone, layers of a GIS are not read: tests/formats/wucaps, tests/formats/gis."""
    assert {f.name for f in FORMATS if f.write} == {
        *(name.split()[0] for name in CASES),
        "wucaps",
        "geopackage",
        "geojson",
    }


@pytest.mark.parametrize("name", [f.name for f in FORMATS if "cameras" in f.written and f.name in CASES])
def test_a_distortion_that_the_target_lacks_is_fitted_told_and_refused_beyond_what_is_allowed(
    tmp_path: Path, name: str
) -> None:
    declared = next(f for f in FORMATS if f.name == name)
    block = made_block(FULL)
    brown = replace(block.cameras, distortion=np.array(["brown"]))
    p = block.camera_parameters
    value = np.select([p.name == "k1", p.name == "p1"], [3e-4, 1e-5], 0.0)
    bent = OrientedBlock(replace(block, cameras=brown, camera_parameters=replace(p, value=value)))
    if name in ("tables", "bingo"):  # the one has it, the other frees the image points of it
        write_as(declared, bent, tmp_path / "out", Writing(lens_misfit_px=0.0), SILENT)
        return
    told = Told()
    write_as(declared, bent, tmp_path / "out", Writing(lens_misfit_px=50.0), told)
    (line,) = [line for line in told.lines if "has no exact like" in line]
    assert float(re.search(r"differs by up to (\S+) px", line)[1]) < 50.0
    with pytest.raises(
        AatriError, match=r"has no exact like; .* more than 0 px(?s:.*)`aatri export` a run without `--m"
    ):
        write_as(declared, bent, tmp_path / "refused", Writing(lens_misfit_px=0.0), told)
    assert not (tmp_path / "refused").exists()


@pytest.mark.parametrize("name", [name for name in CASES if " " not in name])
def test_what_a_format_has_no_place_for_is_told(tmp_path: Path, name: str) -> None:
    declared = next(f for f in FORMATS if f.name == name)
    block, told = made_block(CASES[name].distortion), Told()
    timed = replace(block, images=replace(block.images, time_s=np.arange(4.0), strip=np.full(4, -1)))
    write_as(declared, OrientedBlock(timed), tmp_path / "out", Writing(), told)
    lines = [line for line in told.lines if "has no place for" in line]
    assert ("times (4)" in "".join(lines)) == ("times" not in declared.written)


@pytest.mark.parametrize("rotation", ["omega-phi-kappa", "phi-omega-kappa", "yaw-pitch-roll"])
@pytest.mark.parametrize("angle", ["deg", "gon", "rad"])
def test_lists_in_each_system_and_unit_of_angles_give_the_same_rotations(
    tmp_path: Path, rotation: str, angle: str
) -> None:
    names = {"omega-phi-kappa": "omega phi kappa", "phi-omega-kappa": "phi omega kappa"}.get(rotation, "yaw pitch roll")
    said: dict[str, Any] = {"columns": f"image X Y Z {names}", "angle": angle, "rotation": rotation}
    block = made_block(FULL)
    declared = next(f for f in FORMATS if f.name == "table")
    write_as(declared, OrientedBlock(block), tmp_path, Writing(**said), SILENT)
    parts = read_source(tmp_path / "orientations.txt", Reading(**said, format="table"), SILENT)
    np.testing.assert_allclose(parts.exterior["ground_from_image"], OrientedBlock(block).ground_from_image, atol=1e-14)


@pytest.mark.parametrize("preset", PRESETS)
def test_every_preset_is_written_and_read_by_its_name(tmp_path: Path, preset: str) -> None:
    block = made_block(FULL)
    declared = next(f for f in FORMATS if f.name == "table")
    write_as(declared, OrientedBlock(block), tmp_path, Writing(columns=preset), SILENT)
    parts = read_source(tmp_path / "orientations.txt", Reading(columns=preset, format="table"), SILENT)
    np.testing.assert_allclose(parts.exterior["ground_from_image"], OrientedBlock(block).ground_from_image, atol=1e-14)
    np.testing.assert_array_equal(parts.exterior["position_m"], block.exterior.position_m)
