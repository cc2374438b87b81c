"""The datum of a free component: which of its points and images are known on the ground, and what is held instead.

Control, positions and distances take part together, with their weights. Attitudes do where these leave a rotation open,
and are compared otherwise: a boresight that nobody measured turns them all. Where neither control nor positions are
given the first projection centre is held at the origin, without attitudes its direction as it is, without distances
the first base at 1: what holds seven scalars changes no shape.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from aatri.adapters.ground.initial_observed import Ground
from aatri.arrays import Bool, Float, Int
from aatri.artifacts.block import Block
from aatri.geometry.vectors import finite_rows
from aatri.observations.geodetic.sights import Sights
from aatri.observations.image_points import ImagePointRows
from aatri.observations.positions import KIND as POSITION
from aatri.observations.ties import HELD
from aatri.orientation.bodies.datum import Datum, FreeBody
from aatri.orientation.bodies.given_relations import GivenAttitudes, Lengths
from aatri.orientation.graph.component import ImageComponent

PRECISION = 3.0
"""Standard deviations of a ray that a point or projection centre of a component is off, in object space."""

HELD_SIGMA = 1e-6
"""Standard deviation of what is held, m or rad."""

HELD_ROW = (np.array([-1]), np.array(["held"]))
"""Row and name of the same: none of the block's."""


@dataclass(frozen=True)
class Known:
    """Rows of what is known of a component.

    Attributes
    ----------
    control, position : (k,) int
        In control and positions of the `Ground`.
    lengths : tuple of (Lengths, (k,) int)
        Distances with both ends in the component, kind by kind.
    attitude : (k,) int
        In the attitudes.
    """

    control: Int
    position: Int
    lengths: tuple[tuple[Lengths, Int], ...]
    attitude: Int

    @property
    def placed(self) -> bool:
        """Whether anything tells where the component lies."""
        return bool(len(self.control) or len(self.position))


def known_of(ground: Ground, component: ImageComponent | FreeBody) -> Known:
    """What is known of a component."""
    known, images = finite_rows(component.xyz), component.images
    lengths = []
    for part in ground.lengths:
        s = part.sights
        ends = [
            np.where(is_image, images[np.where(is_image, row, 0)], known[np.where(is_image, 0, row)])
            for row, is_image in ((s.station, s.station_is_image), (s.target, s.target_is_image))
        ]
        rows = np.flatnonzero(ends[0] & ends[1])
        if len(rows):
            lengths.append((part, rows))
    return Known(
        np.flatnonzero(known[ground.control.point]),
        np.flatnonzero(images[ground.positions.image]),
        tuple(lengths),
        np.flatnonzero(images[ground.attitudes.image]),
    )


def without_drifting(block: Block, ground: Ground, known: Known) -> Known:
    """What is known without the positions of drift groups, whose shift is an unknown that only the bundle has."""
    drifts = block.exterior.drift_group[ground.positions.row[known.position]] != ""
    return replace(known, position=known.position[~drifts])


def body_of(component: ImageComponent, rays: ImagePointRows) -> FreeBody:
    """A component as a body: points and images are as precise as rays of typical length."""
    spread = precision(component, rays) ** 2
    covariance = np.broadcast_to(spread * np.eye(3), (len(component.xyz), 3, 3))
    return FreeBody(component.poses, component.xyz, covariance, spread, angle_precision(component, rays))


def datum_of(block: Block, ground: Ground, body: FreeBody, known: Known, *, attitudes: bool = False) -> Datum:
    """The datum of a body by control, positions, distances and, where asked for, attitudes."""
    c, p, poses = ground.control, ground.positions, body.poses
    control, position = known.control, known.position
    image = p.image[position]
    n = len(control) + len(position)
    ends = _ends(known, c.point[control], len(body.xyz), n)
    distances = tuple(part.take(rows).between(*place) for (part, rows), place in zip(known.lengths, ends.place))
    x = np.concatenate([body.xyz[c.point[control]], poses.position_m[image], ends.where(body)])
    more = len(x) - n
    return Datum(
        name=tuple(f"point {i}" for i in block.points.id[c.point[control]])
        + tuple(f"image {i}" for i in block.images.id[image])
        + ends.names(block),
        x=x,
        covariance=np.concatenate(
            [body.covariance[c.point[control]], _centres(body, len(image)), ends.covariance(body)]
        ),
        offset_m=np.concatenate(
            [
                np.zeros((len(control), 3)),
                np.einsum("nij,nj->ni", poses.ground_from_image[image], p.lever_arm_m[position]),
                np.zeros((more, 3)),
            ]
        ),
        xyz_m=np.concatenate(
            [c.xyz_m[control] - ground.origin_m, p.position_m[position] - ground.origin_m, np.zeros((more, 3))]
        ),
        covariance_m2=np.concatenate([c.covariance_m2[control], p.covariance_m2[position], np.zeros((more, 3, 3))]),
        given=np.concatenate([c.given[control], p.given[position], np.zeros((more, 3), dtype=bool)]),
        n_control=len(control),
        n_given=n,
        distances=distances,
        row=np.append(np.concatenate([c.row[control], p.row[position]]), np.full(more, -1)),
        id=np.array([*block.points.id[c.point[control]], *block.images.id[image], *ends.names(block)], dtype=np.str_),
        attitudes=_attitudes(block, ground, body, known.attitude) if attitudes else None,
    )


def held_datum(block: Block, ground: Ground, body: FreeBody, known: Known) -> tuple[Datum, Known]:
    """A datum without control and positions: the first projection centre is held, the direction without attitudes.

    And what is known that takes part in it.

    Parameters
    ----------
    body : FreeBody
        There the first image stays where it is, and the scale without distances.
    """
    if not len(known.attitude):  # nothing tells what is up
        known = replace(
            known,
            lengths=tuple((part, some) for part, rows in known.lengths if len(some := rows[~part.levelled[rows]])),
        )
    made = datum_of(block, ground, body, known, attitudes=True)
    first = int(np.flatnonzero(body.images)[0])
    spot = body.poses.position_m[first : first + 1]
    attitudes = made.attitudes
    if attitudes is None:
        eye, R = np.eye(3)[None], body.poses.ground_from_image[first : first + 1]
        attitudes = GivenAttitudes(
            f"{HELD} direction", -np.ones(1, dtype=int), np.array(["held"]), R, R, eye, HELD_SIGMA**2 * eye
        )
    distances = tuple(d.between(d.sights.station + 1, d.sights.target + 1) for d in made.distances)
    x = np.concatenate([spot, made.x])
    if not distances:
        base = np.linalg.norm(body.poses.position_m - spot, axis=1)
        farthest = int(np.nanargmax(base))
        x = np.concatenate([spot, body.poses.position_m[farthest : farthest + 1]])
        distances = (_held_base(float(base[farthest])),)
    n = len(x)
    held = Datum(
        name=("held", *made.name),
        x=x,
        covariance=_centres(body, n),
        offset_m=np.zeros((n, 3)),
        xyz_m=np.zeros((n, 3)),
        covariance_m2=np.tile(HELD_SIGMA**2 * np.eye(3), (n, 1, 1)),
        given=np.concatenate([np.ones((1, 3), dtype=bool), np.zeros((n - 1, 3), dtype=bool)]),
        n_control=1,
        n_given=1,
        distances=distances,
        attitudes=attitudes,
        row=np.full(n, -1),
        kinds=(f"{HELD} place", POSITION),
    )
    return held, known


def _held_base(length: float) -> Lengths:
    """A distance from the first row of a datum to the second."""
    row, name = HELD_ROW
    zero, one, no, none = np.zeros(1), np.ones(1), np.zeros(1, dtype=bool), np.array([""])
    sights = Sights(row, row + 1, row + 2, no, no, zero, zero, length * one, HELD_SIGMA * one, name, none, none, none)
    return Lengths(f"{HELD} base", sights, no)


@dataclass(frozen=True)
class Ends:
    """Rows of a datum for the ends of distances: those of the control points, and further ones behind all given.

    Attributes
    ----------
    row : (k,) int
        Of the further ones, in points or images.
    is_image : (k,) bool
    place : tuple of ((n,) int, (n,) int)
        Rows of the datum of start and end of the distances, kind by kind.
    """

    row: Int
    is_image: Bool
    place: tuple[tuple[Int, Int], ...]

    def where(self, body: FreeBody) -> Float:
        """The further ones in the body, (k, 3)."""
        image, zero = self.is_image, np.zeros_like(self.row)
        at, of = (np.where(some, self.row, zero) for some in (image, ~image))
        return np.where(image[:, None], body.poses.position_m[at], body.xyz[of])

    def covariance(self, body: FreeBody) -> Float:
        """Of the same, (k, 3, 3)."""
        image = self.is_image
        return np.where(image[:, None, None], _centres(body, len(image)), body.covariance[np.where(image, 0, self.row)])

    def names(self, block: Block) -> tuple[str, ...]:
        """What messages call them."""
        both = zip(self.row.tolist(), self.is_image.tolist())
        return tuple(f"image {block.images.id[r]}" if image else f"point {block.points.id[r]}" for r, image in both)


def _ends(known: Known, control_point: Int, n_points: int, first: int) -> Ends:
    """Ends of the known distances; `first` rows of the datum are given."""
    sights = [part.sights.take(rows) for part, rows in known.lengths]
    empty = [np.zeros(0, dtype=np.int64)]
    row = np.concatenate([*empty, *(end for s in sights for end in (s.station, s.target))]).astype(np.int64)
    kinds = [end for s in sights for end in (s.station_is_image, s.target_is_image)]
    is_image = np.concatenate([np.zeros(0, dtype=bool), *kinds])
    of_control = np.full(n_points, -1, dtype=np.int64)
    of_control[control_point] = np.arange(len(control_point))
    place = np.where(is_image, -1, of_control[np.where(is_image, 0, row)])
    further, at = np.unique(2 * row[place < 0] + is_image[place < 0], return_inverse=True)
    place[place < 0] = first + at
    pieces = np.split(place, np.cumsum([len(end) for s in sights for end in (s.station, s.target)])[:-1])
    return Ends(further // 2, further % 2 == 1, tuple(zip(pieces[::2], pieces[1::2])) if sights else ())


def _centres(body: FreeBody, n: int) -> Float:
    """Covariances of n projection centres."""
    return np.tile(body.centre_variance * np.eye(3), (n, 1, 1))


def _attitudes(block: Block, ground: Ground, body: FreeBody, rows: Int) -> GivenAttitudes | None:
    if not len(rows):
        return None
    a = ground.attitudes
    back = np.linalg.inv(a.turning[rows])
    own = body.turn_rad**2 * back @ back.swapaxes(1, 2)
    return GivenAttitudes(
        "attitude",
        a.row[rows],
        block.images.id[a.image[rows]],
        body.poses.ground_from_image[a.image[rows]],
        a.ground_from_image[rows],
        a.turning[rows],
        a.covariance_rad2[rows] + own,
    )


def precision(component: ImageComponent, rays: ImagePointRows) -> float:
    """Standard deviation of points and centres of a component, in its unit: that of a ray at its typical length."""
    rows = np.flatnonzero(component.kept)
    away = component.xyz[rays.point[rows]] - component.poses.position_m[rays.image[rows]]
    per_mm = np.linalg.norm(away, axis=1) / rays.c_mm[rows]
    return PRECISION * max(component.spread, 0.1) * float(np.median(per_mm * rays.sigma_mm[rows].mean(axis=1)))


def angle_precision(component: ImageComponent, rays: ImagePointRows) -> float:
    """Standard deviation of the rotations of a component, rad: that of a ray."""
    rows = np.flatnonzero(component.kept)
    angle = float(np.median(rays.sigma_mm[rows].mean(axis=1) / rays.c_mm[rows]))
    return PRECISION * max(component.spread, 0.1) * angle
