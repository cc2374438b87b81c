"""Points and perspective centres of bodies - strips, models, components - as observations of the ground.

    v = X - x_o(t),     dv/dX = I,    dv/dt = -dx_o/dt           C = C_o(t) + tau^2 I

A body goes to the ground by a transformation with unknowns t of its own (`orientation.bodies`): x_o is one of its
points there, C_o its covariance, which turns with the body. X is a ground point, or the projection centre of an image,
an unknown that control, positions and distances observe as well. tau is the deformation of the bodies, which an
adjustment may count beside their covariances (`adjusting`).

Ground points are eliminated by the adjustment. For k bodies of equal weight that leaves the factor (I - 11'/k): own
block (k-1)/k, mutual block -1/k, for any number of bodies (docs/formulas.md 4.3).
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

import numpy as np

from aatri.adjustment.records import Records, Weigh
from aatri.adjustment.unknowns import State, Unknowns
from aatri.arrays import Float, Int, Text
from aatri.observations.observed import Observed, Spread, named
from aatri.observations.poses import POINT, by_unknowns, position

S = TypeVar("S")

BODY = "strip"
"""Name of the group of the bodies' unknowns."""

STRIP_TIE, MODEL_TIE, PERSPECTIVE_CENTRE = "strip_tie", "model_tie", "perspective_centre"
COMPONENT_POINT, COMPONENT_CENTRE, COMPONENT_ROTATION = "component_point", "component_centre", "component_rotation"
HELD = "held"
"""Kinds: points of strips and of models, the perspective centres of these; points, projection centres and rotations of
images of a component; what a component is held by where its datum is free."""


@dataclass(frozen=True)
class Ties(Generic[S]):
    """Points of bodies as functions of the unknowns of the bodies."""

    body: Int
    block: Int
    """(n,) int32. Bodies, and ground points or images."""
    on_ground: Callable[[S, Int], Float]
    """(values of the bodies' unknowns, rows) -> ground coordinates (n, 3)."""
    derivatives: Callable[[S, Int], Float]
    """(the same) -> their derivatives by the unknowns of the body (n, 3, k)."""
    spectrum: Callable[[S], tuple[Float, Float]]
    """Values of the bodies' unknowns -> eigenvalues (n, 3), m^2, and eigenvectors (n, 3, 3), by columns, of the
    covariances on the ground."""
    unknowns: Unknowns
    """The group of the bodies, named `BODY`."""
    linear: bool = False
    """Ground coordinates are linear in the unknowns."""
    compiled: Callable[[Int], Weigh] | None = None
    """Faster lane of ties at ground points, see adjustment.records."""
    group: str = POINT
    """Group of what they tie the bodies to: points or images."""

    @property
    def rows(self) -> Int:
        """All rows."""
        return np.arange(len(self.body))

    def records(self, kind: str) -> Records:
        """Records of the ties, of unit weight: an adjustment weighs them by their covariances at its state."""
        eye = np.eye(3)

        def evaluate(state: State, rows: Int) -> tuple[Float, tuple[Float, ...]]:
            bodies, X = state[BODY], position(state, self.group)
            v = X[self.block[rows]] - self.on_ground(bodies, rows)
            by_block = by_unknowns(self.group, np.broadcast_to(eye, (len(rows), 3, 3)))
            return v, (-self.derivatives(bodies, rows), by_block)

        n = len(self.body)
        touches = ((BODY, self.body), (self.group, self.block))
        unit, used = np.broadcast_to(eye, (n, 3, 3)), np.ones(n, dtype=bool)
        return Records(kind, touches, evaluate, unit, used, self.compiled, linear=self.linear)

    def observed(self, kind: str, body: Text, block: Text, start: S) -> Observed:
        """The ties as observations of a kind, which brings the unknowns of the bodies along.

        Parameters
        ----------
        body, block : (n,) str
            What messages call the bodies, and the points or images.
        start : S
            Of the bodies.
        """
        own: Mapping[str, Any] = {BODY: start}
        return Observed(
            self.records(kind),
            np.full(len(self.body), -1),
            named(body, block),
            "m",
            unknowns=(self.unknowns,),
            start=own,
            spread=self._spread(own),
        )

    def _spread(self, state: State) -> Spread:
        """The covariances at a state. A function that names itself, in its place, would keep all arrays of the ties."""
        return Spread(*self.spectrum(state[BODY]), self._spread)

    def places(self, bodies: S, n: int) -> Float:
        """Ground coordinates of n points, (n, 3), by the first body that has each; zero where none has."""
        X = np.zeros((n, 3))
        X[self.block[::-1]] = self.on_ground(bodies, self.rows)[::-1]
        return X
