"""Oriented strips as a Solution: images and points on the ground, transformations, notes.

Between artifacts and the methods that orient strips: strip points in, a Solution back out.

Transformations, residuals and suspects of the strip block adjustment, as tables of a Solution; the same in figures.

Figures are counts as textbooks have them, tie residuals, what lies beyond control and ties.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from aatri.adapters import solution as assemble
from aatri.adapters.limits import BEYOND_ALL_CONTROL, BEYOND_CONTROL
from aatri.arrays import Bool, Float, Int, Text, finite_rows
from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.residuals import Residuals, Tests
from aatri.artifacts.solution import Iterations, Parameters, Solution, StripTransformations, VarianceComponents
from aatri.artifacts.strips import Strips
from aatri.artifacts.suspects import Suspects, Uncontrolled
from aatri.geometry.rotations import angles_from_rotation
from aatri.geometry.similarity import Similarity
from aatri.geometry.strip_bases import StripAxes
from aatri.ids import several
from aatri.notes import Note
from aatri.observations.control import Control
from aatri.orientation.bodies.component_growth import BodyPoints
from aatri.orientation.bodies.similarity_ties import in_axes
from aatri.orientation.bodies.strip_polynomials import StripPolynomials, textbook_counts

SIMILARITY_PARAMETERS = ("TX_m", "TY_m", "TZ_m", "scale", "omega_rad", "phi_rad", "kappa_rad")

AXES = ("origin_X_m", "origin_Y_m", "origin_Z_m", "half_range_U_m", "half_range_V_m", "azimuth_of_U_rad")


def left_out(block: Block, oriented: Bool) -> list[Note]:
    """A warning that names the images in use that are not oriented."""
    left = np.flatnonzero(~oriented & block.images.active)
    text = f"not oriented ({len(left)} of {len(block.images)} images)"
    return [Note("warning", text, tuple(block.images.id[left].tolist()))] if len(left) else []


def similarity_rows(
    name: str, similarity: Similarity, origin_m: Float, sigma: npt.ArrayLike = np.nan
) -> StripTransformations:
    """The seven parameters from the free strip to the ground; angles omega, phi, kappa of the rotation."""
    values = [
        *(similarity.translation + origin_m),
        similarity.scale,
        *angles_from_rotation(similarity.rotation, "omega-phi-kappa"),
    ]
    return StripTransformations.of(
        id=name, model="similarity", parameter=SIMILARITY_PARAMETERS, value=values, sigma=sigma
    )


def precision_row(name: str, tau_m: float) -> Parameters:
    """The deformation of strips that was added to the standard deviation of their points."""
    return Parameters.of(group="strip_precision", object=[name], name="tau_m", value=tau_m, sigma=np.nan)


@dataclass(frozen=True)
class Placed:
    """Images and points of a block on the ground."""

    position_m: Float
    """(n_images, 3), m. NaN where not oriented."""
    ground_from_image: Float
    """(n_images, 3, 3)."""
    point_m: Float
    """(n_points, 3), m. NaN where not determined."""


def solution_of(
    block: Block,
    image_points: ImagePoints | None,
    placed: Placed,
    *,
    method: str,
    counts: tuple[int, int],
    sigma0: float,
    iterations: int,
    residuals: Residuals,
    suspects: Suspects,
    transformations: StripTransformations | None = None,
    parameters: Parameters | None = None,
    point_covariance_m2: Float | None = None,
    image_covariance: Float | None = None,
    sigma0_um: float = float("nan"),
    uncontrolled: Uncontrolled | None = None,
    tests: Tests | None = None,
    components: VarianceComponents | None = None,
) -> Solution:
    """A Solution of images and points on the ground; the cameras are as given.

    Parameters
    ----------
    counts : (int, int)
        Observations and unknowns.
    point_covariance_m2 : (n_points, 3, 3) float64, m^2, optional
    image_covariance : (n_images, 6, 6) float64, m and rad, optional
    uncontrolled : Uncontrolled, optional
    tests : Tests, optional
        Of the observations in the order of the residuals.
    components : VarianceComponents, optional
    """
    oriented, solved = finite_rows(placed.position_m), finite_rows(placed.point_m)
    rays = np.zeros(len(oriented), dtype=np.int64), np.zeros(len(solved), dtype=np.int64)
    if image_points is not None:
        measured = image_points.measurements
        used = measured.active & finite_rows(measured.xy_mm) & oriented[measured.image] & solved[measured.point]
        rays = (
            np.bincount(measured.image[used], minlength=len(oriented)),
            np.bincount(measured.point[used], minlength=len(solved)),
        )
    return Solution(
        method=method,
        observations=counts[0],
        unknowns=counts[1],
        redundancy=counts[0] - counts[1],
        sigma0=sigma0,
        sigma0_um=sigma0_um,
        iterations=iterations,
        images=assemble.oriented_images(block, placed.position_m, placed.ground_from_image, rays[0], image_covariance),
        points=assemble.ground_points(block, placed.point_m, rays[1], point_covariance_m2),
        cameras=assemble.solved_cameras(block),
        transformations=StripTransformations.empty() if transformations is None else transformations,
        parameters=Parameters.empty() if parameters is None else parameters,
        residuals=residuals,
        history=Iterations.empty(),
        suspects=suspects,
        uncontrolled=uncontrolled,
        tests=tests,
        variance_components=components,
    )


@dataclass(frozen=True)
class StripsOnGround:
    """Oriented strips on the ground, reduced to the origin; `rows` are those of the strip points in the Strips."""

    origin: Float
    strips: Int
    similarity: list[Similarity]
    axes: list[StripAxes]
    rows: Int
    points: BodyPoints
    control: Control


def transformation_tables(
    result: StripPolynomials, ground: StripsOnGround, strips: Strips, sigma_m: Float
) -> list[StripTransformations]:
    """Per strip: the similarity, the axes, and the coefficients a of dU, b of dV, c of dW in metres."""
    tables = []
    for k, strip in enumerate(ground.strips):
        name, axes = str(strips.strips.id[strip]), ground.axes[k]
        tables.append(similarity_rows(name, ground.similarity[k], ground.origin))
        plan, height = (int(degree) for degree in result.degree[k])
        origin_m, size_m = axes.origin_m + ground.origin, axes.half_range_m
        azimuth = np.arctan2(axes.ground_from_axes[0, 0], axes.ground_from_axes[1, 0])
        tables.append(
            StripTransformations.of(
                id=name,
                model=result.basis.model(max(plan, height)),
                parameter=AXES,
                value=[*origin_m, *size_m, azimuth],
            )
        )
        for part, degree in enumerate((plan, height)):
            of_part = np.flatnonzero((result.basis.part == part) & (result.basis.degree <= degree))
            names = tuple(result.basis.labels[c] for c in of_part)
            values, sigma = result.coefficients_m[k, of_part], sigma_m[k, of_part]
            model = result.basis.model(degree)
            tables.append(StripTransformations.of(id=name, model=model, parameter=names, value=values, sigma=sigma))
    return tables


def strip_notes(
    block: Block, strips: Strips, ground: StripsOnGround, result: StripPolynomials, names: Text
) -> Iterator[Note]:
    """Points at infinity, counts, RMS of the tie residuals of every strip, and points that are extrapolated.

    Ties carry control from strip to strip, but not beyond all of it: where no strip has any, all bend together.
    """
    distant = np.isin(strips.strip_points.strip, ground.strips)
    distant[ground.rows] = False
    if distant.any():
        ids = block.points.id[np.unique(strips.strip_points.point[distant])]
        text = "points at infinity, or so uncertain that they may be, left out of the strips that hold them so"
        yield Note("warning", text, tuple(ids.tolist()))
    equations, coefficients = textbook_counts(result, ground.points, ground.control)
    text = f"{equations} equations of control and ties, {coefficients} coefficients of {len(names)} strips, redundancy"
    yield Note("note", f"{text} {equations - coefficients} (ground points eliminated)")
    points, tied = ground.points, result.tied
    active = tied.active[: len(points.point)]
    often = np.bincount(points.point[active], minlength=len(block.points))[points.point] > 1
    v = result.point_m[points.point] - result.corrected_m
    local, _ = in_axes(points, ground.axes)
    controlled_points = often.copy()
    control = np.zeros(len(block.points), dtype=bool)
    control[ground.control.point[tied.active[len(points.point) :]]] = True
    controlled_points |= control[points.point]
    at_control = result.point_m[control & np.isfinite(result.point_m[:, 0])]
    used = np.flatnonzero(active)
    used = used[np.argsort(points.strip[used], kind="stable")]
    bounds = np.searchsorted(points.strip[used], np.arange(len(names) + 1))
    for k, name in enumerate(names):
        of_strip = used[bounds[k] : bounds[k + 1]]
        shared = of_strip[often[of_strip]]
        if len(shared):
            x, y, z = np.sqrt((v[shared] ** 2).mean(axis=0))
            largest = np.abs(v[shared]).max()
            text = f"strip {name}: RMS of {len(shared)} tie residuals X {x:.3f}, Y {y:.3f}, Z {z:.3f} m"
            yield Note("note", f"{text}, largest {largest:.3f} m")
        bends = int(result.degree[k].max()) > 0
        axes = ground.axes[k]
        controlled = ((at_control - axes.origin_m) @ axes.ground_from_axes)[:, :2] / axes.half_range_m
        off = _beyond(local[of_strip], local[of_strip[controlled_points[of_strip]]] if bends else local[:0])
        far = _beyond(local[of_strip], controlled if bends else local[:0])
        own, of_block = off > BEYOND_CONTROL, far > BEYOND_ALL_CONTROL
        for rows, by, what in ((own, off, "its control and ties"), (of_block & ~own, far, "all control of the block")):
            if rows.any():
                text = (
                    f"strip {name}: {several(int(rows.sum()), 'point', 'lies', 'lie')} beyond {what}, by up to "
                    f"{by[rows].max() / 2:.0%} of its length or width: extrapolated"
                )
                yield Note("warning", text, tuple(block.points.id[points.point[of_strip][rows]].tolist()))


def _beyond(local: Float, inside: Float) -> Float:
    """By how much of the half range points of a strip, in its axes, lie outside the range of others; 0 without any."""
    if not len(inside):
        return np.zeros(len(local))
    return np.asarray(np.maximum(local - inside.max(axis=0), inside.min(axis=0) - local).max(axis=1))
