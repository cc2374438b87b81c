"""All records of a block in one row, kind after kind, as the rules of the search see them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from aatri.adjustment.statistics.rejection import redundancy_in_records
from aatri.arrays import Bool, Float, Int
from aatri.observations.observed import Observed
from aatri.observations.poses import POINT, POSE
from aatri.orientation.bundle.block import BundleInput
from aatri.orientation.bundle.result import BundleResult
from aatri.orientation.bundle.rounds import Key, keys_of

Array = TypeVar("Array", Bool, Float)

DATUM = 7.0
"""Coordinates that place a block."""


@dataclass(frozen=True)
class AllRecords:
    """All records, kind after kind."""

    observed: tuple[Observed, ...]
    """With nothing rejected."""
    first: Int
    """(kinds + 1,) int64. Where each kind begins."""
    native: Bool
    """(n,). What is measured and may be rejected: neither a prior nor a condition."""
    at_points: Bool
    """(n,). Records that touch one point, so that the others of the point can judge them."""
    point: Int
    """(n,) int32. That point; -1 none."""
    image: Int
    """(n,) int32. The image that a record touches; -1 none."""
    coordinates: Bool
    """(n,). Records of that point alone: given coordinates."""

    @classmethod
    def of(cls, block: BundleInput) -> AllRecords:
        """The records of a block."""
        observed = tuple(o.again() for o in block.observed)
        native, point, image, alone_at_point = [], [], [], []
        for o in observed:
            measured = not o.components and (not o.exact or is_of_image(o))
            touched = [blocks for group, blocks in o.records.touches if group == POINT]
            poses = [blocks.astype(np.int32) for group, blocks in o.records.touches if group == POSE]
            native.append(o.records.active & measured)
            touches_one_point = len(touched) == 1 and measured
            alone_at_point.append(np.full(len(o), touches_one_point and len(o.records.touches) == 1))
            image.append(poses[0] if poses else np.full(len(o), -1, dtype=np.int32))
            point.append(touched[0].astype(np.int32) if touches_one_point else np.full(len(o), -1, dtype=np.int32))
        empty = np.zeros(0, dtype=np.int32)
        points = np.concatenate([empty, *point])
        first = np.cumsum([0, *(len(o) for o in observed)])
        return cls(
            observed,
            first,
            np.concatenate([empty == 1, *native]),
            points >= 0,
            points,
            np.concatenate([empty, *image]),
            np.concatenate([empty == 1, *alone_at_point]),
        )

    @property
    def parts(self) -> list[slice]:
        """Where the records of each kind are."""
        return [slice(int(a), int(b)) for a, b in zip(self.first[:-1], self.first[1:])]

    def split(self, values: Array) -> tuple[Array, ...]:
        """Values of all records, kind by kind."""
        return tuple(values[part] for part in self.parts)

    def keys(self, mask: Bool) -> tuple[Key, ...]:
        """Kind and row of some records."""
        return tuple(key for o, kind_mask in zip(self.observed, self.split(mask)) for key in keys_of(o, kind_mask))

    @property
    def tests(self) -> int:
        """Components that can be tested."""
        return sum(
            int(o.records.observed_components()[native].sum())
            for o, native in zip(self.observed, self.split(self.native))
        )

    def redundancy(self, result: BundleResult | None) -> tuple[Float, Int]:
        """Redundancy of each kind, in records, half of them where it is not known; and how many there are."""
        count = np.array([int(self.native[part].sum()) for part in self.parts], dtype=np.int64)
        redundancy = np.asarray(0.5 * count, dtype=np.float64)
        native = [
            o.used & part for o, part in zip(() if result is None else result.observations, self.split(self.native))
        ]
        placing = sum(_placing(o)[rows].sum() for o, rows in zip(self.observed, native))
        datum_share = max(0.0, 1.0 - DATUM / max(placing, 1.0))  # seven of them may be all that gives the datum
        for i, o in enumerate(() if result is None else result.observations):
            rows = np.flatnonzero(native[i])
            exact = o.observed.demanded()[rows].sum(axis=1).astype(np.float64)
            m = o.observed.records.observed_components()[rows].sum(axis=1) * (not o.observed.exact)
            r = 0.0 * m if o.observed.exact else m - np.einsum("nii->n", o.covariance[rows])
            redundancy[i] = redundancy_in_records(r + datum_share * exact, m + exact)
        return redundancy, count

    def smallest(self, number: Sequence[Int], factor: Float) -> Float:
        """Smallest factor of the classes of each record's components, (n,)."""
        if (factor == 1.0).all():
            return np.broadcast_to(1.0, len(self.native))
        class_factor = np.append(factor, 1.0)
        return np.concatenate([np.zeros(0), *(class_factor[n].min(axis=1) for n in number if n.shape[1])])

    def rejected_in(self, block: BundleInput) -> Bool:
        """What earlier stages have rejected, (n,)."""
        parts = [np.zeros(len(o), dtype=bool) if o.rejected is None else o.rejected for o in block.observed]
        return np.concatenate([np.zeros(0, dtype=bool), *parts])

    def without(self, observed: Sequence[Observed], active: Bool) -> tuple[Observed, ...]:
        """Observations less those that are not active; conditions that an earlier stage has rejected stay out."""
        rejected = self.split(self.native & ~active)
        return tuple(o if o.exact and not is_of_image(o) else o.again().without(r) for o, r in zip(observed, rejected))


def is_of_image(o: Observed) -> bool:
    """Whether these are values of a single image: what is exact of a position or attitude may be wrong, as control."""
    return _of_single(o) == [POSE]


def _of_single(o: Observed) -> list[str]:
    """The groups of poses and points that each record touches: one, where it is a value of a single image or point."""
    return [group for group, _ in o.records.touches if group in (POSE, POINT)]


def _placing(o: Observed) -> Int:
    """How many coordinates or angles each record gives of a single point or image, (n,): these place a block."""
    values = (o.records.observed_components() | o.demanded()).sum(axis=1)
    return np.asarray(values if len(_of_single(o)) == 1 and not o.components else 0 * values)


def is_ray(o: Observed) -> bool:
    """Whether these are measurements in images (their points tell which is wrong), or none at all."""
    groups = {group for group, _ in o.records.touches}
    return o.exact or bool(o.components) or {POSE, POINT} <= groups
