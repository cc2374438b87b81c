"""Photographs made up for tests: a textured relief seen by a camera of known orientation, with EXIF.

Pixels are rays from the projection centre, met with the relief by fixed-point iteration; nothing of aatri is used.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from scipy.ndimage import map_coordinates

Array = npt.NDArray[Any]

WIDTH, HEIGHT, F_PX = 480, 360, 430.0
FLOWN_M, EAST_M, NORTH_M = 100.0, 500_000.0, 5_300_000.0
SENSOR_MM = 6.0
TEXEL_M = 0.15


@dataclass(frozen=True)
class Photographed:
    """A folder of photographs and where they were taken."""

    folder: Path
    names: list[str]
    position_m: Array
    ground_from_image: Array


def relief(x: Array, y: Array) -> Array:
    """Height, m."""
    return np.asarray(6.0 * np.sin(x / 17.0) * np.cos(y / 23.0) + 0.03 * x)


@lru_cache(1)
def texture() -> Array:
    """Brightness of the ground, 300 m x 300 m from (-100, -100), with detail of all sizes: 1/f noise."""
    size = round(300 / TEXEL_M)
    f = np.hypot(np.fft.fftfreq(size)[:, None], np.fft.rfftfreq(size)[None, :])
    spectrum = np.fft.rfft2(np.random.default_rng(25).normal(size=(size, size))) / np.maximum(f, 2.0 / size)
    ground = np.fft.irfft2(spectrum * np.exp(-((f / 0.3) ** 4)), (size, size))
    return np.asarray(128 + 45 * ground / np.std(ground))


def photograph(ground: Array, position_m: Array, R: Array, noise: float = 2.0, seed: int = 0) -> Array:
    """Grey values (HEIGHT, WIDTH) of 8 bits; R turns image axes (x right, y up, z back) to the ground's."""
    column, row = np.meshgrid(np.arange(WIDTH), np.arange(HEIGHT))
    u = np.stack([column - (WIDTH - 1) / 2, (HEIGHT - 1) / 2 - row, np.full(column.shape, -F_PX)], axis=-1) @ R.T
    z = np.zeros(column.shape)
    for _ in range(25):
        at = position_m + u * ((z - position_m[2]) / u[..., 2])[..., None]
        z = relief(at[..., 0], at[..., 1])
    rows, columns = (at[..., 1] + 100) / TEXEL_M, (at[..., 0] + 100) / TEXEL_M
    grey = map_coordinates(ground, [rows, columns], order=1, mode="reflect")
    return np.clip(grey + np.random.default_rng(seed).normal(0, noise, grey.shape), 0, 255).round().astype(np.uint8)


def rtk_packet(position_m: Array, rng: np.random.Generator) -> bytes:
    """XMP of a drone with an RTK fix, its errors as it says."""
    sigma = np.array([0.02, 0.02, 0.04])
    lon, lat, h = _degrees(position_m + rng.normal(0, sigma))
    stated = {"GpsLatitude": lat, "GpsLongitude": lon, "AbsoluteAltitude": h, "RtkFlag": 50}
    stated |= {f"RtkStd{axis}": s for axis, s in zip(("Lon", "Lat", "Hgt"), sigma)}
    text = " ".join(f'drone-dji:{key}="{value!r}"' for key, value in ((k, float(v)) for k, v in stated.items()))
    rdf = "http://www.w3.org/1999/02/22-rdf-syntax-ns#"
    spaces = f'xmlns:rdf="{rdf}" xmlns:drone-dji="http://www.dji.com/drone-dji/1.0/"'
    return (
        f'<x:xmpmeta xmlns:x="adobe:ns:meta/"><rdf:RDF {spaces}><rdf:Description {text}/></rdf:RDF></x:xmpmeta>'
    ).encode()


def _degrees(position_m: Array) -> tuple[float, float, float]:
    from pyproj import Transformer

    to_degrees = Transformer.from_crs("EPSG:32632", "EPSG:4979", always_xy=True)
    return to_degrees.transform(EAST_M + position_m[0], NORTH_M + position_m[1], position_m[2])


def exif_of(position_m: Array, time_s: float = 0.0, focal_mm: float = 0.0, **tags: Any) -> Any:
    """EXIF with the position of a photograph, and a focal length that is 12 % too large."""
    Image = pytest.importorskip("PIL.Image")
    lon, lat, h = _degrees(position_m)
    exif = Image.Exif()
    exif[271], exif[272] = "Made", tags.pop("model", "Up")
    exif[274] = tags.pop("orientation", 1)
    focal_mm = focal_mm or 1.12 * F_PX * SENSOR_MM / WIDTH
    clock = f"2026:01:01 10:{int(time_s) // 60:02d}:{int(time_s) % 60:02d}"
    exif.get_ifd(0x8769).update({36867: clock, 37386: focal_mm, 40962: WIDTH, 41486: WIDTH / SENSOR_MM, 41488: 4})
    if tags.pop("position", True):
        exif.get_ifd(0x8825).update({1: "N", 2: _dms(lat), 3: "E", 4: _dms(lon), 5: b"\0", 6: h})
    return exif


def _dms(degrees: float) -> tuple[float, float, float]:
    whole, minutes = int(degrees), degrees % 1 * 60
    return float(whole), float(int(minutes)), minutes % 1 * 60


def flown(folder: Path, strips: int = 2, per_strip: int = 3) -> Photographed:
    """Strips to and fro, 70 % of overlap along, 60 % across, tilted by some degrees, each 20 m below the last."""
    Image = pytest.importorskip("PIL.Image")
    rng, ground = np.random.default_rng(7), texture()
    folder.mkdir(parents=True, exist_ok=True)
    names, positions, rotations = [], [], []
    for strip in range(strips):
        for k in range(per_strip):
            along = k if strip % 2 == 0 else per_strip - 1 - k
            position = np.array([32.0 * along, 32.0 * strip, FLOWN_M - 20 * strip]) + rng.normal(0, 1.5, 3)
            omega, phi, kappa = rng.normal(0, 0.03, 3) + np.array([0, 0, np.pi * (strip % 2)])
            R = _about(0, omega) @ _about(1, phi) @ _about(2, kappa)
            name = f"P{len(names):02d}"
            picture = Image.fromarray(photograph(ground, position, R, seed=len(names)))
            exif, xmp = exif_of(position, 5.0 * len(names)), rtk_packet(position, rng)
            picture.save(folder / f"{name}.jpg", quality=97, exif=exif, xmp=xmp)
            names.append(name)
            positions.append(position)
            rotations.append(R)
    return Photographed(folder, names, np.array(positions), np.array(rotations))


def _about(axis: int, angle: float) -> Array:
    c, s = np.cos(angle), np.sin(angle)
    i, j = [k for k in range(3) if k != axis]
    R = np.eye(3)
    sign = -1.0 if axis == 1 else 1.0
    R[i, i] = R[j, j] = c
    R[i, j], R[j, i] = -s * sign, s * sign
    return R
