"""Cameras as programs state them: focal lengths and principal point in px, and a distortion in the program's own terms.

All distortions in use are of three families. With u right and v DOWN in normalised coordinates (principal distance 1),

    polynomial   forward, ideal to measured, about the centre of distortion (the principal point but in MicMac):
                 L = (1 + k1 r^2 + k2 r^4 + k3 r^6 + k_r8 r^8 + ...) / (1 + k4 r^2 + k5 r^4 + k6 r^6)
                 u_d = u L + 2 p1 u v + p2 (r^2 + 2 u^2) + a1 u + a2 v,  then u_d + b1 u_d + b2 v_d
                 v_d = v L + p1 (r^2 + 2 v^2) + 2 p2 u v
    fisheye      r_d = theta (1 + k1 theta^2 + k2 theta^4 + k3 theta^6 + k4 theta^8)
    correction   the other way, measured to ideal, with r, u, v of the measured point: u_d and the same terms
                 k1 k2 k3 p1 p2 added to it, b1 u + b2 v too

These terms (OpenCV's names, for it has most of them) are what `FORMS` translates a program's parameters into: another
name, the order of p1 and p2, and the unit, a power of the focal length. A further program is a row of the table.

Sources: docs/formats.md names the manual of each program.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Literal, NamedTuple

import numpy as np

from aatri.arrays import Float
from aatri.camera.models import forward_models
from aatri.camera.models.inversion import invert
from aatri.formats.conventions.pixel_origins import PIXEL_MM

RADIAL = ("k1", "k2", "k3", "k_r8", "k_r10", "k_r12", "k_r14")
POWER = {"k1": 2, "k2": 4, "k3": 6, "k4": 2, "k5": 4, "k6": 6, "k_r8": 8, "k_r10": 10, "k_r12": 12, "k_r14": 14,
         "p1": 1, "p2": 1, "a1": 0, "a2": 0, "b1": 0, "b2": 0}  # fmt: skip
"""Power of the focal length by which a term in px (or mm) is multiplied to be normalised."""

STEP = 1e-30
"""Step of the complex step by which a distortion is differentiated: exact to the last digits."""


class Term(NamedTuple):
    """What a parameter is here: term, power of the focal length that normalises it, sign."""

    name: str
    power: int = 0
    sign: float = 1.0


class DistortionForm(NamedTuple):
    """How a program writes a distortion.

    family : polynomial, fisheye or correction.
    terms : what each parameter is, in the program's order.
    unit : what lengths are counted in: principal distances, px or mm.
    focal_lengths : 1 where the program knows square pixels only.
    principal_point : False where it lies in the image centre.
    own_centre : the distortion has a centre apart from the principal point.
    """

    family: Literal["polynomial", "fisheye", "correction"]
    terms: Mapping[str, Term]
    unit: Literal["normalised", "px", "mm"] = "normalised"
    focal_lengths: int = 2
    principal_point: bool = True
    own_centre: bool = False


def _same(names: str) -> dict[str, Term]:
    return {name: Term(name) for name in names.split()}


def _named(names: str, terms: str, *, in_unit: bool = False) -> dict[str, Term]:
    return {a: Term(b, POWER[b] if in_unit else 0) for a, b in zip(names.split(), terms.split(), strict=True)}


COLMAP = {
    "SIMPLE_PINHOLE": DistortionForm("polynomial", {}, focal_lengths=1),
    "PINHOLE": DistortionForm("polynomial", {}),
    "SIMPLE_RADIAL": DistortionForm("polynomial", _same("k1"), focal_lengths=1),
    "RADIAL": DistortionForm("polynomial", _same("k1 k2"), focal_lengths=1),
    "OPENCV": DistortionForm("polynomial", _same("k1 k2 p1 p2")),
    "FULL_OPENCV": DistortionForm("polynomial", _same("k1 k2 p1 p2 k3 k4 k5 k6")),
    "OPENCV_FISHEYE": DistortionForm("fisheye", _same("k1 k2 k3 k4")),
    "SIMPLE_RADIAL_FISHEYE": DistortionForm("fisheye", _same("k1"), focal_lengths=1),
    "RADIAL_FISHEYE": DistortionForm("fisheye", _same("k1 k2"), focal_lengths=1),
    "SIMPLE_FISHEYE": DistortionForm("fisheye", {}, focal_lengths=1),
    "FISHEYE": DistortionForm("fisheye", {}),
}
"""Camera models of COLMAP that we know; its parameters are the focal lengths, the principal point, these."""

FORMS: dict[str, DistortionForm] = {
    # ours
    "none": DistortionForm("polynomial", {}),
    "bal": DistortionForm("polynomial", _same("k1 k2")),
    "opencv": DistortionForm("polynomial", _same("k1 k2 p1 p2 k3 k4 k5 k6")),
    "polynomial": DistortionForm(
        "polynomial",
        _named("k1 k2 k3 k4 k5 k6 k7 p1 p2 a1 a2 b2", "k1 k2 k3 k_r8 k_r10 k_r12 k_r14 p1 p2 a1 a2 b2"),
    ),
    "fisheye": DistortionForm("fisheye", _same("k1 k2 k3 k4")),
    "brown": DistortionForm(
        "correction",
        {
            "k1": Term("k1", 2),
            "k2": Term("k2", 4),
            "k3": Term("k3", 6),
            "p1": Term("p2", 1),
            "p2": Term("p1", 1, -1.0),
            "b1": Term("b1"),
            "b2": Term("b2", 0, -1.0),
        },
        unit="mm",
    ),
    # of others
    "blocksexchange": DistortionForm("polynomial", _named("K1 K2 K3 P1 P2", "k1 k2 k3 p2 p1"), focal_lengths=1),
    "blocksexchange-affine": DistortionForm("polynomial", _named("K1 K2 K3 P1 P2 shear", "k1 k2 k3 p2 p1 b2")),
    "bundler": DistortionForm("polynomial", _same("k1 k2"), focal_lengths=1, principal_point=False),
    **{f"colmap-{name}": form for name, form in COLMAP.items()},
    "metashape": DistortionForm(
        "polynomial",
        _named("k1 k2 k3 k4 p1 p2", "k1 k2 k3 k_r8 p2 p1") | {"b1": Term("b1", -1), "b2": Term("b2", -1)},
        unit="px",
        focal_lengths=1,
    ),
    "micmac": DistortionForm(
        "polynomial",
        _named("R1 R2 R3 R4 R5 R6 R7 P1 P2 b1 b2", "k1 k2 k3 k_r8 k_r10 k_r12 k_r14 p2 p1 a1 a2", in_unit=True),
        unit="px",
        focal_lengths=1,
        own_centre=True,
    ),
    "mmvii": DistortionForm(
        "polynomial",
        _named("K1 K2 K3 K4 K5 K6 K7 p1 p2 b1 b2", "k1 k2 k3 k_r8 k_r10 k_r12 k_r14 p2 p1 a1 a2"),
        focal_lengths=1,
    ),
    "nvm": DistortionForm("correction", _named("r", "k1"), focal_lengths=1, principal_point=False),
    "opensfm-brown": DistortionForm("polynomial", _same("k1 k2 p1 p2 k3")),
    "opensfm-simple_radial": DistortionForm("polynomial", _same("k1")),
    "opensfm-radial": DistortionForm("polynomial", _same("k1 k2")),
    "opensfm-perspective": DistortionForm("polynomial", _same("k1 k2"), focal_lengths=1, principal_point=False),
    "opensfm-fisheye": DistortionForm("fisheye", _same("k1 k2"), focal_lengths=1, principal_point=False),
    "opensfm-fisheye_opencv": DistortionForm("fisheye", _same("k1 k2 k3 k4")),
    "opf": DistortionForm("polynomial", _named("R1 R2 R3 T1 T2", "k1 k2 k3 p1 p2"), focal_lengths=1),
    "pix4d": DistortionForm("polynomial", _named("R1 R2 R3 T1 T2", "k1 k2 k3 p1 p2")),
}
"""Distortions by program; the first six are the models of aatri."""


@dataclass(frozen=True)
class Lens:
    """A camera as a program states it."""

    id: str
    form: str
    """One of `FORMS`."""
    size_px: tuple[float, float]
    """(width, height)."""
    focal_px: tuple[float, float]
    """(fx, fy)."""
    principal_point_px: tuple[float, float] = (0.0, 0.0)
    """(2,) float, px. From the image centre, x right, y down."""
    parameters: Mapping[str, float] = field(default_factory=dict)
    """By the program's names; what is missing is zero."""
    centre_px: tuple[float, float] = (0.0, 0.0)
    """(2,) float, px. Centre of the distortion, from the principal point."""
    pixel_mm: float = PIXEL_MM
    """Width of a pixel."""
    where: str = ""
    """Its place in a file."""

    def unit_per_focal(self) -> float:
        """The focal length in the unit in which the program counts lengths."""
        unit = FORMS[self.form].unit
        return {"normalised": 1.0, "px": self.focal_px[0], "mm": self.focal_px[0] * self.pixel_mm}[unit]

    def terms(self) -> dict[str, float]:
        """The distortion in the terms of its family."""
        f, form = self.unit_per_focal(), FORMS[self.form]
        return {t.name: t.sign * self.parameters.get(name, 0.0) * f**t.power for name, t in form.terms.items()}

    def projected(self, uv: Float) -> Float:
        """Image coordinates (n, 2) px, from the image centre, y down, of ideal normalised coordinates (n, 2)."""
        family, terms = FORMS[self.form].family, self.terms()
        if family == "correction":
            distorted = invert(with_derivative(lambda d: d + correction(d, terms)), uv, what=self.form)
        elif family == "fisheye":
            distorted = forward_models.fisheye(uv, terms)[0]
        else:
            distorted = polynomial(uv, terms, np.divide(self.centre_px, self.focal_px))
        return np.asarray(distorted * self.focal_px + self.principal_point_px)

    def ideal(self, xy_px: Float) -> Float:
        """Ideal normalised coordinates (n, 2) of image coordinates (n, 2) px, from the image centre, y down."""
        family, terms = FORMS[self.form].family, self.terms()
        distorted = (xy_px - self.principal_point_px) / self.focal_px
        if family == "correction":
            return np.asarray(distorted + correction(distorted, terms))
        if family == "fisheye":
            return invert(lambda uv: forward_models.fisheye(uv, terms), distorted, what=self.form)
        centre = np.divide(self.centre_px, self.focal_px)
        return invert(with_derivative(lambda uv: polynomial(uv, terms, centre)), distorted, what=self.form)


def polynomial(uv: Float, terms: Mapping[str, float], centre: Float | None = None) -> Float:
    """Distorted normalised coordinates (n, 2) of ideal ones; real or complex."""
    t = terms.get
    from_centre = uv if centre is None else uv - centre
    u, v = from_centre.T
    q = u**2 + v**2
    above = sum(t(name, 0.0) * q**k for k, name in enumerate(RADIAL, 1))
    below = q * (t("k4", 0.0) + q * (t("k5", 0.0) + q * t("k6", 0.0)))
    gain = (1 + above) / (1 + below) - 1
    p1, p2 = t("p1", 0.0), t("p2", 0.0)
    u_d = uv[:, 0] + u * gain + 2 * p1 * u * v + p2 * (q + 2 * u**2) + t("a1", 0.0) * u + t("a2", 0.0) * v
    v_d = uv[:, 1] + v * gain + 2 * p2 * u * v + p1 * (q + 2 * v**2)
    return np.stack([u_d + t("b1", 0.0) * u_d + t("b2", 0.0) * v_d, v_d], axis=1)


def correction(uv: Float, terms: Mapping[str, float]) -> Float:
    """What is added to measured normalised coordinates (n, 2); real or complex."""
    t = terms.get
    u, v = uv.T
    q = u**2 + v**2
    gain = q * (t("k1", 0.0) + q * (t("k2", 0.0) + q * t("k3", 0.0)))
    p1, p2 = t("p1", 0.0), t("p2", 0.0)
    du = u * gain + 2 * p1 * u * v + p2 * (q + 2 * u**2) + t("b1", 0.0) * u + t("b2", 0.0) * v
    return np.stack([du, v * gain + 2 * p2 * u * v + p1 * (q + 2 * v**2)], axis=1)


def with_derivative(function: Callable[[Float], Float]) -> Callable[[Float], tuple[Float, Float]]:
    """A function of the plane (n, 2) -> (n, 2) with its derivative (n, 2, 2), by the complex step."""

    def both(uv: Float) -> tuple[Float, Float]:
        columns = [function(uv + 1j * STEP * axis).imag / STEP for axis in np.eye(2)]
        return function(uv), np.stack(columns, axis=2)

    return both
