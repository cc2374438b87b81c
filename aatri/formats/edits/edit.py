"""One edit of a block, and what may stand in it.

    do: switch_off   kind with its ids; of control and positions `coordinates: XZ` of them only
    do: renumber     an image point is of the point `to`
    do: exchange     of an image point or control point with the point `to`, of a position with the image `to`
    do: reweight     standard deviations of a kind, or of one of its image, point, `group`, times `factor`;
                     of control and positions `coordinates: Z` of them only

`value` is what was measured when the edit was proposed: an edit whose observation has another value by now is refused.
"""

from dataclasses import dataclass, replace

ACTIONS = ("switch_off", "renumber", "exchange", "reweight")

NAMED_BY = {
    "image_point": ("image", "point"),
    "fiducial": ("image", "point"),
    "control": ("point",),
    "position": ("image",),
    "attitude": ("image",),
}
"""What names an observation of a kind; every other kind is a type of geodetic.csv, named by `from`, `to` and `via`."""

GEODETIC = ("from", "to")

TAKES = {
    "switch_off": (*NAMED_BY, "geodetic"),
    "renumber": ("image_point",),
    "exchange": ("image_point", "control", "position"),
    "reweight": ("image_point", "control", "position", "attitude", "geodetic"),
}
"""The kinds that an action is for."""

BY_COORDINATE = {"control", "position"}
"""Kinds of which single coordinates can be switched off and reweighted."""


@dataclass(frozen=True)
class Edit:
    """One edit.

    Attributes
    ----------
    do : {'switch_off', 'renumber', 'exchange', 'reweight'}
    kind : str
        image_point, fiducial, control, position, attitude, or a type of geodetic observation.
    ids : dict of str to str
        By the keys image, point, from, to, via, group.
    coordinates : str
        Those of X, Y, Z that are meant.
    value : tuple of float
        As measured: mm or px of an image point, m (east, north, up) of control and positions, rad of attitudes, m or
        rad of geodetic observations; empty: not compared.
    factor : float
        On standard deviations.
    reason : str
    where : str
        `file:line:column`.
    """

    do: str
    kind: str
    ids: dict[str, str]
    coordinates: str = "XYZ"
    value: tuple[float, ...] = ()
    factor: float = 1.0
    reason: str = ""
    where: str = ""

    @property
    def family(self) -> str:
        """The kind, or `geodetic`."""
        return self.kind if self.kind in NAMED_BY else "geodetic"

    def same_as(self, other: "Edit") -> bool:
        """Whether both change the same observation in the same way, whatever the reason; weights may change again."""
        return self.do != "reweight" and replace(self, reason="", where="") == replace(other, reason="", where="")

    def __str__(self) -> str:
        words = [self.do, self.kind, *(word for name in self.ids.items() for word in name)]
        if self.coordinates != "XYZ":
            words.insert(2, self.coordinates)
        return " ".join(words) + (f" x {self.factor:g}" if self.do == "reweight" else "")
