"""A block as it was read: what no reader may let through is refused, what cannot be used is set aside by name.

Seen: everything the other checks of this room look for; they are called here, in their order.
Test: on the tables of a `Block` in which everything else is still active this is repeated until nothing changes:

1. image point outside the image format by more than 5 % of the format -> rejected; image that fits its neighbours only
   as a mirror image -> rejected;
2. point seen in one image only, without control and without other observations -> its image points are rejected;
3. image with fewer than 3 points, without an observed position and without a photograph (`path`), in which points may
   yet be found -> rejected, with its image points.

Ground points with a role that no image shows are listed, but keep their role. If more than `max_reject_share` of the
image points would go by rule 1, a unit or the format is wrong: an error, with the first places. Points seen once (2)
and images with few points (3) are no reason to refuse the others, however many, as long as an image is left.
The outcome depends on the content alone, so that a block written out and read again is screened to the same.
"""

from dataclasses import dataclass, field, replace

import numpy as np

from aatri.arrays import Bool, Float, Int
from aatri.artifacts.block import CHECK, CONTROL, NOT_SEEN, OBSERVED_VALUE, Block
from aatri.checks.as_read.angles import angles_that_differ
from aatri.checks.as_read.cameras import camera_figures, cameras_of, distances_by_scale
from aatri.checks.as_read.control_ids import joined, lost_control
from aatri.checks.as_read.control_place import control_off_the_block
from aatri.checks.as_read.control_rays import control_rays, photo_mm
from aatri.checks.as_read.copies import without_copies
from aatri.checks.as_read.coverage import coverage, imprecision
from aatri.checks.as_read.exchanged_images import exchanged_images
from aatri.checks.as_read.frame import outside_of_its_frame
from aatri.checks.as_read.lever_arms import impossible_lever_arms
from aatri.checks.as_read.measured_twice import measured_twice, of_image_and_point
from aatri.checks.as_read.mirrored_images import (
    EITHER_CAMERA,
    EITHER_REMEDY,
    MIRRORED,
    MIRRORED_CAMERA,
    mirrored_cameras,
    mirrored_images,
)
from aatri.checks.as_read.positions import without_impossible_positions
from aatri.checks.as_read.rejects import in_order, listed, name_of_image_point, rejected, told_rejects
from aatri.checks.as_read.unusable_sights import without_unusable_sights
from aatri.checks.as_read.values import wrong_values
from aatri.checks.finding import Finding, report
from aatri.checks.limits import FEWEST_IMAGE_POINTS, FORMAT_MARGIN, MAX_REJECT_SHARE
from aatri.ids import amounts, shown
from aatri.progress import SILENT, Reporter

REJECT_SHARE = "largest share of image points outside the format, or impossible positions, to set aside; else an error"
"""What the option of that name says."""

OUTSIDE = "outside the image format"
SEEN_ONCE = "seen in one image only"
REJECTED_IMAGE = "its image is rejected"
FEW_POINTS = f"fewer than {FEWEST_IMAGE_POINTS} points and no observed position"


@dataclass
class Rows:
    """Rows of one table: what is left active, and the reasons of what is not."""

    active: Bool
    reasons: dict[int, str] = field(default_factory=dict)

    def reject(self, rows: Int, reason: str) -> None:
        """Set rows aside."""
        self.active[rows] = False
        self.reasons.update({int(row): reason for row in rows})

    def of_reason(self, reason: str) -> list[int]:
        """The rows that a reason has set aside."""
        return sorted(row for row, other in self.reasons.items() if other == reason)


def screened(
    block: Block,
    reporter: Reporter = SILENT,
    max_reject_share: float = MAX_REJECT_SHARE,
    *,
    copies: bool = False,
    elsewhere: Bool | None = None,
) -> Block:
    """The block with what cannot be used set inactive and listed in `rejects`.

    Parameters
    ----------
    block : Block
        With the active flags as the files give them; rows in `rejects` are kept.
    reporter : Reporter
        Gets a warning per reject, and the counts of the block.
    max_reject_share : float
        Largest share of the image points that may lie outside the format, and of the positions that cannot be.
    copies : bool
        What is given twice counts twice: for problems that are defined by all their rows.
    elsewhere : (n_points,) bool, optional
        Points that images of other blocks show too: of these one image is enough.

    Raises
    ------
    InputError
        If values are impossible, measurements disagree, more than the share would be rejected, or no image is left.
    """
    report(wrong_values(block), reporter)
    block = without_unusable_sights(block)
    block, of_copies = (block, []) if copies else without_copies(block)
    block, of_positions = without_impossible_positions(block, max_reject_share)
    of_ids = lost_control(block)
    images, points = Rows(block.images.active.copy()), Rows(block.image_points.active.copy())
    points.reject(np.flatnonzero(_outside_format(block) & points.active), OUTSIDE)
    xy_mm = photo_mm(block)
    usable = points.active & np.isfinite(xy_mm).all(axis=1)
    mirrored, either = mirrored_cameras(block, xy_mm, usable)
    for k in mirrored:
        images.reject(np.flatnonzero(block.images.camera == k), MIRRORED_CAMERA.format(block.cameras.id[k]))
    images.reject(mirrored_images(block, xy_mm, usable & images.active[block.image_points.image]), MIRRORED)
    while _reject_round(
        block, images, points, _has_prior(block) if elsewhere is None else _has_prior(block) | elsewhere
    ):
        pass
    problems = [*measured_twice(block), *of_positions, *of_ids, *_too_many(block, images, points, max_reject_share)]
    if len(either):
        problems.append(_error(EITHER_CAMERA.format(shown(block.cameras.id[either])), EITHER_REMEDY, ""))
    if any(problem.level == "error" for problem in problems):  # what was set aside before may be why so little is left
        report([*told_rejects(block.rejects), *(p for p in problems if p.level == "error")], reporter)
    report(control_off_the_block(block), reporter)
    report(_held_against_control(block, xy_mm, points.active), reporter)
    block = _with_rejects(block, images, points)
    report([*of_copies, *of_ids, *told_rejects(block.rejects)], reporter)
    reporter.log(f"block {block.name}: {amounts(block.metrics())}")
    return block


def _held_against_control(block: Block, xy_mm: Float, active: Bool) -> list[Finding]:
    """What positions, control and cameras say against each other, and a line of figures per camera."""
    camera = block.images.camera[block.image_points.image]
    usable, cameras = active & np.isfinite(xy_mm).all(axis=1), cameras_of(block)
    rays = control_rays(block, xy_mm, usable)
    of_ray = block.images.camera[rays.image]
    more, by_scale = distances_by_scale(block, xy_mm, usable & ~np.isin(camera, of_ray))
    distance = np.linalg.norm(rays.control_m[rays.point] - rays.position_m[rays.image], axis=1)
    figures = camera_figures(cameras, np.concatenate([of_ray, more]), np.concatenate([distance, by_scale]))
    impossible = impossible_lever_arms(block, of_ray, distance)
    in_place = (block.cameras.image_coordinates == "photo") | (block.cameras.kind == "digital")
    rows = usable & in_place[camera]
    covered = coverage(cameras, camera[rows], xy_mm[rows])
    covered += imprecision(cameras, camera[usable], xy_mm[usable], block.image_points.sigma_mm[usable])
    if any(finding.level == "error" for finding in covered):
        return [*figures, *impossible, *covered]
    if impossible:
        return [*figures, *impossible]
    exchanged = exchanged_images(block, xy_mm, usable)
    return [*figures, *covered, *outside_of_its_frame(block), *angles_that_differ(block, xy_mm, usable), *exchanged]


def _outside_format(block: Block) -> Bool:
    """Image points more than the margin outside.

    The axes of a comparator or of a scan have no known place on the film, so nothing is outside there: interior
    orientation tells.
    """
    cameras = block.cameras
    size = cameras.format
    corner = np.isin(cameras.pixel_origin, ["top-left-corner", "top-left-centre", "bottom-left-corner"])
    from_corner = (corner & (cameras.image_coordinates == "pixel"))[:, None]
    low, high = np.where(from_corner, 0.0, -size / 2), np.where(from_corner, size, size / 2)
    scanned = (cameras.kind == "film") & (cameras.image_coordinates == "pixel")
    unknown = ((cameras.image_coordinates == "comparator") | scanned)[:, None]
    low = np.where(unknown, np.nan, low - FORMAT_MARGIN * size)
    high = np.where(unknown, np.nan, high + FORMAT_MARGIN * size)
    camera = block.images.camera[block.image_points.image]
    xy = block.image_points.xy
    return np.asarray(((xy < low[camera]) | (xy > high[camera])).any(axis=1))


def _reject_round(block: Block, images: Rows, points: Rows, has_coordinates: Bool) -> bool:
    """Apply rules 2 and 3 once; whether anything was rejected. Of known points one image is enough."""
    rows = block.image_points
    once = points.active & (_images_per_point(block, points.active) < 2)[rows.point] & ~has_coordinates[rows.point]
    points.reject(np.flatnonzero(once), SEEN_ONCE)
    count = np.bincount(rows.image[of_image_and_point(block, points.active)], minlength=len(block.images))
    few = images.active & (count < FEWEST_IMAGE_POINTS) & ~_has_position(block) & (block.images.path == "")
    images.reject(np.flatnonzero(few), FEW_POINTS)
    orphans = points.active & ~images.active[rows.image]
    points.reject(np.flatnonzero(orphans), REJECTED_IMAGE)
    return bool(once.any() or few.any() or orphans.any())


def _images_per_point(block: Block, active: Bool) -> Int:
    """Number of images in which each point has an active measurement."""
    return np.bincount(block.image_points.point[of_image_and_point(block, active)], minlength=len(block.points))


def _has_prior(block: Block) -> Bool:
    """Points that one ray may determine: control, or with geodetic observations or relative control."""
    return block.points_given_as(CONTROL) | joined(block)


def _has_position(block: Block) -> Bool:
    rows = block.exterior
    observed = (rows.position_use == OBSERVED_VALUE) & np.isfinite(rows.position_m).all(axis=1)
    return np.isin(np.arange(len(block.images)), rows.image[observed])


def _too_many(block: Block, images: Rows, points: Rows, share: float) -> list[Finding]:
    """An error where too much lies outside the format, or no image is left."""
    rows, outside = block.image_points, points.of_reason(OUTSIDE)
    if len(outside) > share * len(rows):
        text = f"{len(outside)} of {len(rows)} image points: {OUTSIDE}; at most {share:.0%} may be set aside: "
        remedy = (
            "check unit, origin, axes and `format` of the camera in block.yaml; or allow more with max_reject_share"
        )
        places = [block.read_at(rows, row) for row in outside]
        return [_error(text + listed([name_of_image_point(block, row) for row in outside], places), remedy, places[0])]
    if images.active.any() or not images.reasons:
        return []
    removed, once = sorted(images.reasons), points.of_reason(SEEN_ONCE)
    at, at_once = [block.read_at(block.images, row) for row in removed], [block.read_at(rows, row) for row in once]
    text = f"no image is left: {len(removed)} of {len(block.images)} with {FEW_POINTS}: "
    text += listed(block.images.id[removed].tolist(), at)
    if once:
        text += f"; {len(once)} of {len(rows)} image points {SEEN_ONCE}: "
        text += listed([name_of_image_point(block, row) for row in once], at_once)
    remedy = "check that a point has the same id in all images; measure more points, or give observed positions"
    return [_error(text, remedy, (at_once or at)[0])]


def _with_rejects(block: Block, images: Rows, points: Rows) -> Block:
    """The block without the rows, and with what no image shows, listed in its rejects."""
    ground, rows = block.ground_points, list(points.reasons)
    unseen = ground.given_as(CONTROL, CHECK)
    unseen &= ((_images_per_point(block, points.active) == 0) & ~joined(block))[ground.point]
    names = block.images.id[list(images.reasons)].tolist()
    block = rejected(block, "image", block.images, list(images.reasons), names, list(images.reasons.values()))
    names = [name_of_image_point(block, row) for row in rows]
    block = rejected(block, "image_point", block.image_points, rows, names, list(points.reasons.values()))
    of_ground = np.flatnonzero(unseen).tolist()
    names = block.points.id[ground.point[of_ground]].tolist()
    block = rejected(block, "ground_point", ground, of_ground, names, [NOT_SEEN] * len(of_ground))
    return replace(
        block,
        images=replace(block.images, active=images.active),
        image_points=replace(block.image_points, active=points.active),
        rejects=in_order(block.rejects),
    )


def _error(text: str, remedy: str, where: str) -> Finding:
    return Finding("screening", "error", text, remedy, where=where)
