"""Why camera parameters are correlated with each other or with the orientation, and what to do about it.

Reference figures of the coupling of c and Z0 (four strips of eight images, 60/30 %, c = 100 mm, 1,000 m, nine control
points): flat terrain and vertical images 0.999998, with crossed strips flown 20 % higher 0.999999, with relief of 20 %
of the flying height 0.997, with images 15 degrees oblique 0.97, with observed projection centres of 5 cm 0.16.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from aatri.arrays import Float
from aatri.camera.limits import IS_OF_KIND, NOT_DETERMINABLE, WARNED_CORRELATION
from aatri.camera.models.brown import brown_basis
from aatri.camera.parameters.exterior_effects import EXTERIOR, share_in_span

_SCALE = (
    "vertical images of nearly flat terrain cannot tell them apart; observed projection centres (GNSS) or oblique "
    "images separate them, crossed strips and a second flying height do not, relief alone only above 20 % of the "
    "flying height"
)
_SHIFT = (
    "parallel images cannot tell a shift of the principal point from a shift of the flight; observed projection "
    "centres (GNSS) with flights in opposite directions, or oblique images, separate them"
)
_RADIAL = (
    "powers of the same radius always are: their sum is determined over the radii that were measured, the single "
    "coefficients are not; leave out the highest that is not significant"
)
_TANGENTIAL = (
    "a decentred lens looks like a shifted principal point with tilted images; leave out the p terms unless they are "
    "significant, or take images turned by 90 degrees about the viewing direction"
)
_TILT = (
    "a shift of the principal point is nearly a tilt of the image; images turned by 90 and 180 degrees separate them"
)
_AFFINE = "b1 stretches x alone, which is half a change of c; both are determined if images are turned by 90 degrees"

_LEVER_SHIFT = (
    "vertical images of one lever arm cannot tell them apart, both raise all positions; fix or weight the lever arm or "
    "the shift"
)
_POSITION_SCALE = (
    "vertical images of nearly flat terrain cannot tell a change of the principal distance from one of the flying "
    "height; fix or weight one of them, or fly at two heights over control"
)
_STRIP_ALONG = (
    "flown one way they move the strip along itself; flights in opposite directions separate them, or a fixed lever arm"
)
_TIME_ALONG = "at one velocity the time offset is a lever arm along the flight; fix the arm or vary the speed"
_STRIP_DRIFT = (
    "no cross strips hold single strips together, and their drift bends the block between them; fly cross strips at "
    "the ends, give height control along the ends of the strips, or let more positions share a drift (positions.per)"
)
_BOWL = (
    "radial distortion bends parallel images of flat ground into a bowl; height control inside the block, oblique "
    "images or a calibrated lens tell the two apart"
)
_BORESIGHT = (
    "a shifted principal point is nearly a turn of the camera against the IMU; fix or weight one of them, or fly over "
    "control in opposite directions and at two heights"
)
_PLAN = frozenset({"shift x", "shift y"})
_DRIFTS = frozenset({*(f"shift {a}" for a in "xyz"), *(f"drift {a}" for a in "xyz")})

_COUPLINGS: tuple[tuple[frozenset[str], frozenset[str], str], ...] = (
    (frozenset({"c", "f"}), frozenset({"Z0"}), _SCALE),
    (frozenset({"c", "f"}), frozenset({"c", "f"}), "they are the same parameter, leave out one of them"),
    (frozenset({"x0", "y0"}), frozenset({"X0", "Y0"}), _SHIFT),
    (frozenset({"x0", "y0"}), frozenset({"phi", "omega"}), _TILT),
    (frozenset({"x0"}), frozenset({"p1"}), _TANGENTIAL),
    (frozenset({"y0"}), frozenset({"p2"}), _TANGENTIAL),
    (frozenset({"p1", "p2"}), frozenset({"phi", "omega"}), _TANGENTIAL),
    (frozenset({"c", "f"}), frozenset({"b1"}), _AFFINE),
    (frozenset({"k1", "k2", "k3", "k4"}), frozenset({"Z0", "X0", "Y0", "phi", "omega"}), _BOWL),
    (frozenset({"x0", "y0"}), frozenset({"boresight x", "boresight y"}), _BORESIGHT),
    (frozenset({"lever z"}), frozenset({"shift z"}), _LEVER_SHIFT),
    (frozenset({"lever z", "shift z"}), frozenset({"c", "f"}), _POSITION_SCALE),
    (frozenset({"lever x", "lever y"}), frozenset({"time offset"}), _TIME_ALONG),
    (frozenset({"lever x", "lever y", "time offset"}), _PLAN, _STRIP_ALONG),
    (frozenset({"x0", "y0"}), _PLAN | {"lever x", "lever y"}, _SHIFT),
    (_DRIFTS, _DRIFTS, _STRIP_DRIFT),
    (_DRIFTS, frozenset({"Z0", "X0", "Y0"}), _STRIP_DRIFT),
    (frozenset({"k1", "k2", "k3", "k4"}), frozenset({"k1", "k2", "k3", "k4"}), _RADIAL),
)


@dataclass(frozen=True)
class Advice:
    """One high correlation with its reason."""

    first: str
    second: str
    correlation: float
    reason: str
    """Why, and what to do."""

    @property
    def determinable(self) -> bool:
        """False from `NOT_DETERMINABLE` on: an adjustment without a weight on one of the two should be refused."""
        return abs(self.correlation) < NOT_DETERMINABLE

    @property
    def text(self) -> str:
        """A sentence for the user."""
        if self.determinable:
            return f"{self.first} and {self.second} are correlated by {self.correlation:.3f}: {self.reason}"
        both = f"{self.first} and {self.second} cannot be told apart: correlation {self.correlation:.6f}"
        return f"{both}; {self.reason}"


def kinds_of_columns(names: Sequence[str], columns: Float, xy_mm: Float) -> dict[str, str]:
    """What the parameters of a set do, by their columns: c, x0, y0, b1, b2, p1, p2, k1 of any radial; else nothing.

    Names mean other things from set to set. Balanced radial terms have a part of c, decentring one of x0, y0.

    Parameters
    ----------
    names : (s,) sequence of str
    columns : (n, 2, s) float64
        Corrections of image points by the parameters.
    xy_mm : (n, 2) float64, mm
        From the principal point.
    """
    zero, one = np.zeros(len(xy_mm)), np.ones(len(xy_mm))
    scale = float(np.abs(xy_mm).max(initial=0.0)) or 1.0
    radial = brown_basis(xy_mm / scale)  # k1, k2, k3, p1, p2, b1, b2
    c, x0, y0 = xy_mm[:, :, None], np.stack([one, zero], axis=1)[:, :, None], np.stack([zero, one], axis=1)[:, :, None]
    spans = {
        "c": c,
        "x0": x0,
        "y0": y0,
        "b1": radial[:, :, 5:6],
        "b2": radial[:, :, 6:7],
        "p1": np.concatenate([x0, radial[:, :, 3:4]], axis=2),
        "p2": np.concatenate([y0, radial[:, :, 4:5]], axis=2),
        "k1": np.concatenate([c, radial[:, :, :3]], axis=2),
    }
    shares = {kind: share_in_span(columns, span) for kind, span in spans.items()}
    return {
        name: next((kind for kind, share in shares.items() if share[j] > IS_OF_KIND), "")
        for j, name in enumerate(names)
    }


def advise(pairs: Iterable[tuple[str, str, float]], kinds: Mapping[str, str] | None = None) -> list[Advice]:
    """Name the physical reason of high correlations.

    Parameters
    ----------
    pairs : iterable of (name, name, correlation)
        Names as in the parameter sets; unknowns of the orientation as X0, Y0, Z0, phi, omega, kappa, also with their
        image as in `Z0 of image 12`. Upper case as in DBAT's K1 is the same as k1.
    kinds : mapping, optional
        What the parameters of a set do, see `kinds_of_columns`; names that are not there are those of camera models.

    Returns
    -------
    list of Advice
        Of the pairs from `WARNED_CORRELATION` on, in the order given.
    """
    high = [(first, second, rho) for first, second, rho in pairs if abs(rho) >= WARNED_CORRELATION]
    return [Advice(first, second, rho, _reason(first, second, kinds or {})) for first, second, rho in high]


def _reason(first: str, second: str, kinds: Mapping[str, str]) -> str:
    a, b = (kinds.get(name.split()[0], _kind(name)) for name in (first, second))
    for one, other, text in _COUPLINGS:
        if (a in one and b in other) or (b in one and a in other):
            return text
    return "hold or weight the less significant of the two, or add images that separate them (turned, oblique)"


_TWO_WORDS = ("shift", "drift", "lever", "time", "boresight")
SHORT = {"principal_distance": "c", "principal_point.x": "x0", "principal_point.y": "y0"}
"""Other names of the same, of camera models."""


def _kind(name: str) -> str:
    words = name.split()
    if words[0] in _TWO_WORDS:
        return " ".join(words[:2]).lower()
    return words[0] if words[0] in EXTERIOR else SHORT.get(words[0], words[0].lower())
