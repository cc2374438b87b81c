"""The datum of a free component: which of its points and images are known on the ground, and what is held instead.

Control, positions and distances take part together, with their weights. Attitudes do where these leave a rotation open,
and are compared otherwise: a boresight that nobody measured turns them all. Where neither control nor positions are
given the first projection centre is held at the origin, without attitudes its direction as it is, without distances
the first base at 1: what holds seven scalars changes no shape.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from aatri.adapters.ground.initial_observed import Ground, Lengths
from aatri.arrays import Bool, Float, Int
from aatri.artifacts.block import Block
from aatri.geometry.vectors import finite_rows
from aatri.observations.image_points import ImagePointRows
from aatri.orientation.free_block.datum import Datum
from aatri.orientation.free_block.given_relations import GivenAttitudes, GivenDistances
from aatri.orientation.graph.component import Component

PRECISION = 3.0
"""Standard deviations of a ray that a point or projection centre of a component is off, in object space."""

HELD = 1e-6
"""Standard deviation of what is held, m or rad."""


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


def known_of(ground: Ground, component: Component) -> Known:
    """What is known of a component."""
    known, images = finite_rows(component.xyz), component.images
    lengths = []
    for part in ground.lengths:
        s = part.sights
        ends = [np.where(is_image, images[np.where(is_image, row, 0)], known[np.where(is_image, 0, row)])
                for row, is_image in ((s.station, s.station_is_image), (s.target, s.target_is_image))]  # fmt: skip
        rows = np.flatnonzero(ends[0] & ends[1])
        if len(rows):
            lengths.append((part, rows))
    return Known(
        np.flatnonzero(known[ground.control.point]),
        np.flatnonzero(images[ground.positions.image]),
        tuple(lengths),
        np.flatnonzero(images[ground.attitudes.image]),
    )


def datum_of(
    block: Block, ground: Ground, component: Component, rays: ImagePointRows, known: Known, *, attitudes: bool
) -> Datum:
    """The datum of a component by control, positions, distances and, where asked for, attitudes."""
    c, p, poses = ground.control, ground.positions, component.poses
    control, position = known.control, known.position
    image = p.image[position]
    n = len(control) + len(position)
    ends = _Ends(component, control_point=c.point[control])
    distances = tuple(_distances(part, rows, ends, n) for part, rows in known.lengths)
    x = np.concatenate([component.xyz[c.point[control]], poses.position_m[image], ends.places()])
    more = len(x) - n
    return Datum(
        name=tuple(f"point {i}" for i in block.points.id[c.point[control]])
        + tuple(f"image {i}" for i in block.images.id[image])
        + ends.names(block),
        x=x,
        covariance=np.tile(precision(component, rays) ** 2 * np.eye(3), (len(x), 1, 1)),
        offset_m=np.concatenate(
            [np.zeros((len(control), 3)),
             np.einsum("nij,nj->ni", poses.ground_from_image[image], p.lever_arm_m[position]), np.zeros((more, 3))]
        ),
        xyz_m=np.concatenate([c.xyz_m[control] - ground.origin_m, p.position_m[position] - ground.origin_m,
                              np.zeros((more, 3))]),
        covariance_m2=np.concatenate([c.covariance_m2[control], p.covariance_m2[position], np.zeros((more, 3, 3))]),
        given=np.concatenate([c.given[control], np.repeat([[True] * 3, [False] * 3], [len(position), more], axis=0)]),
        n_control=len(control),
        n_given=n,
        distances=distances,
        attitudes=_attitudes(ground, component, rays, known.attitude) if attitudes and len(known.attitude) else None,
    )  # fmt: skip


def held_datum(
    block: Block, ground: Ground, component: Component, rays: ImagePointRows, known: Known
) -> tuple[Datum, Known]:
    """A datum without control and positions: the first projection centre is held, the direction without attitudes.

    And what is known that takes part in it.

    Parameters
    ----------
    component : Component
        In a frame of its own: there the first image stays where it is, and the scale without distances.
    """
    if not len(known.attitude):  # nothing tells what is up
        known = replace(known, lengths=tuple((part, some) for part, rows in known.lengths
                                             if len(some := rows[~part.levelled[rows]])))  # fmt: skip
    made = datum_of(block, ground, component, rays, known, attitudes=True)
    first, second = np.flatnonzero(component.images)[:2].tolist()
    spot = component.poses.position_m[first : first + 1]
    attitudes = made.attitudes
    if attitudes is None:
        eye, R = np.eye(3)[None], component.poses.ground_from_image[first : first + 1]
        attitudes = GivenAttitudes("held direction", np.zeros(1, dtype=np.int32), R, R, eye, HELD**2 * eye)
    distances = tuple(GivenDistances(d.kind, d.start + 1, d.end + 1, d.value_m, d.sigma_m, d.plan, d.rise_m)
                      for d in made.distances)  # fmt: skip
    x = np.concatenate([spot, made.x])
    if not distances:
        x = np.concatenate([spot, component.poses.position_m[second : second + 1]])
        one = np.ones(1)
        distances = (GivenDistances("held base", np.array([0]), np.array([1]), np.linalg.norm(x[1:] - x[:1], axis=1),
                                    HELD * one, one < 0, 0 * one),)  # fmt: skip
    n = len(x)
    held = Datum(
        name=("held", *made.name),
        x=x,
        covariance=np.tile(precision(component, rays) ** 2 * np.eye(3), (n, 1, 1)),
        offset_m=np.zeros((n, 3)),
        xyz_m=np.zeros((n, 3)),
        covariance_m2=np.tile(HELD**2 * np.eye(3), (n, 1, 1)),
        given=np.concatenate([np.ones((1, 3), dtype=bool), np.zeros((n - 1, 3), dtype=bool)]),
        n_control=1,
        n_given=1,
        distances=distances,
        attitudes=attitudes,
    )
    return held, known


class _Ends:
    """Rows of a datum for the ends of distances: control points have theirs, the others get one behind all given."""

    def __init__(self, component: Component, control_point: Int) -> None:
        self.component = component
        self.of_control = {int(point): k for k, point in enumerate(control_point.tolist())}
        self.further: dict[tuple[bool, int], int] = {}

    def rows(self, row: Int, is_image: Bool, first: int) -> Int:
        """Rows of the datum; `first` is how many are given."""
        found = []
        for r, image in zip(row.tolist(), is_image.tolist()):
            if not image and r in self.of_control:
                found.append(self.of_control[r])
            else:
                found.append(first + self.further.setdefault((image, r), len(self.further)))
        return np.array(found, dtype=np.int64)

    def places(self) -> Float:
        """Where the further ones are in the component."""
        c = self.component
        found = [c.poses.position_m[r] if image else c.xyz[r] for image, r in self.further]
        return np.array(found).reshape(-1, 3)

    def names(self, block: Block) -> tuple[str, ...]:
        """What messages call them."""
        return tuple(
            f"image {block.images.id[r]}" if image else f"point {block.points.id[r]}" for image, r in self.further
        )


def _distances(part: Lengths, rows: Int, ends: _Ends, first: int) -> GivenDistances:
    s = part.sights.take(rows)
    return GivenDistances(
        part.kind, ends.rows(s.station, s.station_is_image, first), ends.rows(s.target, s.target_is_image, first),
        s.value, s.sigma, part.plan[rows], s.target_height_m - s.station_height_m,
    )  # fmt: skip


def _attitudes(ground: Ground, component: Component, rays: ImagePointRows, rows: Int) -> GivenAttitudes:
    a = ground.attitudes
    turned = component.poses.ground_from_image[a.image[rows]]
    back = np.linalg.inv(a.turning[rows])
    own = angle_precision(component, rays) ** 2 * back @ back.swapaxes(1, 2)
    return GivenAttitudes("attitude", np.zeros(len(rows), dtype=np.int32), turned, a.ground_from_image[rows],
                          a.turning[rows], a.covariance_rad2[rows] + own)  # fmt: skip


def precision(component: Component, rays: ImagePointRows) -> float:
    """Standard deviation of points and centres of a component, in its unit: that of a ray at its typical length."""
    rows = np.flatnonzero(component.kept)
    away = component.xyz[rays.point[rows]] - component.poses.position_m[rays.image[rows]]
    per_mm = np.linalg.norm(away, axis=1) / rays.c_mm[rows]
    return PRECISION * max(component.spread, 0.1) * float(np.median(per_mm * rays.sigma_mm[rows].mean(axis=1)))


def angle_precision(component: Component, rays: ImagePointRows) -> float:
    """Standard deviation of the rotations of a component, rad: that of a ray."""
    rows = np.flatnonzero(component.kept)
    angle = float(np.median(rays.sigma_mm[rows].mean(axis=1) / rays.c_mm[rows]))
    return PRECISION * max(component.spread, 0.1) * angle
