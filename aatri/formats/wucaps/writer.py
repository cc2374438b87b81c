"""Writing of a Block as WuCAPS files: camera, image coordinates, ground points, roles; the form is that of `files`.

The files hold one camera without distortion, photo coordinates in mm, strips, and ground points with the roles full,
plan-only or height-only control, or check. With the ImagePoints of a later stage the coordinates are those it has
corrected, and count from the principal point; without them those that were measured. What else a Block may hold has
no place in these files and is told: standard deviations, positions, attitudes, times, other observations. Numbers are
written with the fewest digits that give them back.
"""

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np

from aatri.arrays import Bool, Float
from aatri.artifacts.block import APPROXIMATE, CHECK, CONTROL, NO_ROLE, Block
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.solution import Solution
from aatri.errors import Faults, InputError, raise_all
from aatri.formats.parts.format import Writing
from aatri.formats.results.oriented_block import OrientedBlock
from aatri.formats.text.written_files import write_files
from aatri.formats.wucaps.observations import END, observation_lines
from aatri.formats.wucaps.observations import NAME as OBSERVATIONS
from aatri.formats.wucaps.result_files import result_lines
from aatri.ids import several, shown
from aatri.notes import Note, tell
from aatri.progress import Reporter

ROLES = ((CONTROL,) * 3, (CONTROL, CONTROL, NO_ROLE), (NO_ROLE, NO_ROLE, CONTROL), (CHECK,) * 3)
"""East, north, up of full, plan-only and height-only control points, and of check points, in the order of PRECPI."""

SCALE_UNKNOWN = 0
_LAST = "-99 0 0"


def write_oriented(oriented: OrientedBlock, folder: Path, writing: Writing, reporter: Reporter) -> None:
    """Write an oriented block, its solution in files beside; what the files do not hold is told.

    With corrected image points it is as the Solution has it: principal distance, rays without the distortion that the
    bundle took off, from the principal point, and without those that were rejected.

    Raises
    ------
    InputError
        As `write_wucaps`; or if the camera keeps a distortion.
    """
    block, image_points, solution = oriented.block, oriented.image_points, oriented.solution
    if image_points is not None and solution is not None:
        bent = next((lens for lens in oriented.lenses if lens.form != "none"), None)
        if bent is not None:
            what = f"distortion {bent.form} has no place in the files"
            raise InputError(what, where=f"camera {bent.id}", remedy="export the Solution of a bundle, or as tables")
        xy_mm, used = oriented.photo_coordinates
        measured, cameras = image_points.measurements, solution.cameras
        xy_mm = xy_mm - cameras.principal_point_mm[block.images.camera[measured.image]]
        image_points = replace(image_points, measurements=replace(measured, xy_mm=xy_mm, active=used))
        block = replace(block, cameras=replace(block.cameras, principal_distance_mm=cameras.principal_distance_mm))
    tell(write_wucaps(block, folder, image_points, solution), reporter)


def write_wucaps(
    block: Block, folder: Path, image_points: ImagePoints | None = None, solution: Solution | None = None
) -> list[Note]:
    """Write the files: four, that of non-photogrammetric observations where there are any, results of a solution.

    Parameters
    ----------
    folder : Path
        Made if it is not there.
    image_points : ImagePoints, optional
        Corrected photo coordinates; None: as measured.
    solution : Solution, optional
        Orientations, points and residuals, in files beside.

    Returns
    -------
    list of Note
        What the files do not hold.

    Raises
    ------
    InputError
        If the Block has no such form: two cameras, pixels or a lens distortion that nobody corrected, no strips, roles
        or ids that the files cannot tell.
    ResourceError
        If the folder cannot be written.
    """
    _refuse(block, corrected=image_points is not None)
    xy_mm, used = _coordinates(block, image_points)
    texts = {
        "PRECAI": _camera(block, corrected=image_points is not None),
        "PREPHI": _images(block, xy_mm, used),
        "PRECKI": _ground(block),
        "PRECPI": _roles(block),
    }
    observed, lost = observation_lines(block)
    if observed:
        texts[OBSERVATIONS] = [*observed, "-99"]
    if solution is not None:
        texts |= result_lines(solution)
    write_files(folder, {f"{name}.DAT": "\r\n".join([*lines, ""]) for name, lines in texts.items()})
    return [*lost, *_left_out(block, used)]


def _refuse(block: Block, *, corrected: bool) -> None:
    """Raise what stands against the form, all of it at once."""
    cameras, images, problems = block.cameras, block.images, Faults()
    if len(cameras) != 1:
        problems.add(f"{len(cameras)} cameras, WuCAPS files hold one", f"block {block.name}", "export as tables")
    later = "export a Solution, whose image points are corrected, or export as tables"
    for k, name in enumerate(cameras.id if not corrected else ()):
        if cameras.image_coordinates[k] != "photo":
            problems.add(
                f"{cameras.image_coordinates[k]} coordinates, WuCAPS files hold photo coordinates",
                f"camera {name}",
                later,
            )
        if cameras.distortion[k] != "none":
            problems.add(f"distortion {cameras.distortion[k]} has no place in the files", f"camera {name}", later)
    without = images.id[images.strip < 0]
    if len(without):
        problems.add(
            f"images without a strip: {shown(without)}", f"block {block.name}", "give them strips, or export as tables"
        )
    strange = _unwritable([*images.id, *block.points.id, *block.strips.id], images.id)
    if strange:
        what = f"ids that WuCAPS files would read otherwise: {shown(strange)}"
        problems.add(what, f"block {block.name}", "rename them")
    odd = block.ground_points.point[~_has_form(block)]
    if len(odd):
        what = f"roles other than full, plan-only or height-only control or check: {shown(block.points.id[odd])}"
        problems.add(what, f"block {block.name}", "give each point one of these, or export as tables")
    raise_all(problems)


def _unwritable(ids: list[str], images: object) -> list[str]:
    """Ids with blanks or beyond ASCII, ids that end a list; `-` before a photo would make it the last of its strip."""
    bad = {i for i in ids if not i.isascii() or len(i.split()) != 1 or i in END}
    return sorted(bad | {str(i) for i in np.asarray(images) if str(i).startswith("-")})


def _has_form(block: Block) -> Bool:
    """Rows of ground points whose role has a form, (n,); without one only the coordinates stand in PRECKI."""
    role = block.ground_points.role
    free = np.isin(role, [NO_ROLE, APPROXIMATE]).all(axis=1)
    return np.asarray(free | (role[:, None, :] == np.array(ROLES)[None]).all(axis=2).any(axis=1))


def _coordinates(block: Block, corrected: ImagePoints | None) -> tuple[Float, Bool]:
    """Photo coordinates, mm, and which are used, row by row of the Block's image points."""
    if corrected is None:
        return block.image_points.xy, block.image_points.active
    m = corrected.measurements
    return m.xy_mm, m.active & np.isfinite(m.xy_mm).all(axis=1)


def _camera(block: Block, *, corrected: bool) -> list[str]:
    """PRECAI."""
    cameras, marks = block.cameras, block.fiducials
    x0, y0 = (0.0, 0.0) if corrected else cameras.principal_point_mm[0].tolist()
    lines = [f"1 {len(marks)}", f"{float(cameras.principal_distance_mm[0])!r} {x0!r} {y0!r}", "0 0 0"]
    return [*lines, *(f"{name} {x!r} {y!r}" for name, (x, y) in zip(marks.id, marks.xy_mm.tolist())), _LAST]


def _images(block: Block, xy_mm: Float, used: Bool) -> list[str]:
    """PREPHI: strips by the order of the table, photos by their place in the strip."""
    images, rows, lines = block.images, block.image_points, list[str]()
    by_image = np.flatnonzero(used)[np.argsort(rows.image[used], kind="stable")]
    bounds = np.searchsorted(rows.image[by_image], np.arange(len(images) + 1))
    spans = list(pairwise(bounds.tolist()))
    for s, strip in enumerate(block.strips.id):
        members = np.flatnonzero(images.strip == s)
        members = members[np.argsort(images.sequence[members], kind="stable")]
        lines += [f"{strip} {len(members)} {SCALE_UNKNOWN} 0"] if len(members) else []
        for k, image in enumerate(members.tolist()):
            last = k == len(members) - 1
            lines.append(f"{'-' if last else ''}{images.id[image]} 0")
            for row in by_image[slice(*spans[image])].tolist():
                x, y = xy_mm[row].tolist()
                lines.append(f"{block.points.id[rows.point[row]]} {x!r} {y!r}")
            lines.append(_LAST)
    return [*lines, "-99"]


def _ground(block: Block) -> list[str]:
    """PRECKI: north before east; 0 where nothing is known and no role needs it, for the files have no blanks."""
    g, lines = block.ground_points, list[str]()
    for point, xyz, written in zip(g.point, np.nan_to_num(g.xyz_m).tolist(), _is_written(block)):
        if written:
            lines.append(f"{block.points.id[point]} {xyz[1]!r} {xyz[0]!r} {xyz[2]!r}")
    return [*lines, "-99"]


def _is_written(block: Block) -> Bool:
    """Ground points with all coordinates, or at least those that their role needs."""
    g = block.ground_points
    finite, needed = np.isfinite(g.xyz_m), np.isin(g.role, [CONTROL, CHECK])
    return np.asarray(finite.all(axis=1) | (needed.any(axis=1) & (finite | ~needed).all(axis=1)))


def _roles(block: Block) -> list[str]:
    """PRECPI."""
    g = block.ground_points
    by_role = [np.flatnonzero((g.role == np.array(role)).all(axis=1) & _is_written(block)) for role in ROLES]
    names = [str(block.points.id[g.point[row]]) for rows in by_role for row in rows]
    return [" ".join(str(len(rows)) for rows in by_role[:3]), *names, "-99"]


def _left_out(block: Block, used: Bool) -> list[Note]:
    """What a reader of the files will not find."""
    g, notes = block.ground_points, list[Note]()

    def warn(text: str, ids: object = ()) -> None:
        notes.append(Note("warning", text, tuple(str(i) for i in np.asarray(ids).tolist())))

    notes.append(Note("note", "WuCAPS files hold no standard deviations: give them as options when reading"))
    if not _is_written(block).all():
        warn("ground points that lack a coordinate are not written", block.points.id[g.point[~_is_written(block)]])
    filled = _is_written(block) & ~np.isfinite(g.xyz_m).all(axis=1)
    if filled.any():
        warn("0 stands for coordinates that are not known, of plan or height control", block.points.id[g.point[filled]])
    if not used.all():
        warn(f"{several(int((~used).sum()), 'unused image point', 'is', 'are')} not written")
    if len(block.relative_control):
        warn("relative control has no place in WuCAPS files and is not written")
    if block.frames.crs[0] != "local":
        warn(f"the coordinate system {block.frames.crs[0]} is not written")
    return notes
