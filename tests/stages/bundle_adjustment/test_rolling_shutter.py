"""Cameras that move while rows are read out: rays are simulated by iteration for the time of the row they fall on."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

from aatri.artifacts.block import CONTROL, Block
from aatri.artifacts.builder import block_of
from aatri.artifacts.solution import Solution
from aatri.errors import InputError
from aatri.stages.bundle_adjustment.bundle import BundleOptions, bundle
from aatri.stages.interior_orientation.calibrated import calibrated

WIDTH, HEIGHT, F_PX, PIXEL_MM = 2000, 1500, 1800.0, 0.002
READOUT_S, SPEED_M_S, FLOWN_M, NOISE_PX = 0.04, 12.0, 80.0, 0.2
EVERY_S = 2.0


@lru_cache
def _flown(gusts_m_s: float = 0.0, seed: int = 11) -> tuple[Block, np.ndarray]:
    """Two strips to and fro, their true positions; x to the right, y up in the image, flown along y.

    Velocities at the images differ from those of the steps by gusts.
    """
    rng = np.random.default_rng(seed)
    ground = np.array(
        [[x, y, 6 * np.sin(x / 20) + 4 * np.cos(y / 15)] for x in range(-30, 90, 9) for y in range(-30, 150, 9)]
    )
    ground = ground + np.append(rng.normal(0, 1, (len(ground), 2)), np.zeros((len(ground), 1)), axis=1)
    at, turn, time, flown, rows = [], [], [], [], []
    for strip in range(2):
        for k in range(6):
            sign = 1.0 - 2.0 * strip
            along = 24.0 * k if strip == 0 else 120.0 - 24.0 * k
            at.append([60.0 * strip, along, FLOWN_M])
            omega, phi = rng.normal(0, 0.03, 2)
            tilt = np.array([[1, 0, phi], [0, 1, -omega], [-phi, omega, 1]])
            turn.append(
                np.linalg.qr(tilt)[0] @ np.diag(np.sign(np.diag(np.linalg.qr(tilt)[1]))) @ np.diag([sign, sign, 1.0])
            )
            time.append(EVERY_S * (k + 20 * strip))
            flown.append(np.array([0.0, sign * SPEED_M_S, 0.0]) + (rng.normal(0, gusts_m_s, 3) if gusts_m_s else 0.0))
    for i, (X0, R, V) in enumerate(zip(np.array(at), turn, np.array(flown))):
        for p, X in enumerate(ground):
            t = 0.0
            for _ in range(10):  # the row on which the point falls tells when it is exposed
                u = R.T @ (X - X0 - V * t)
                x, y = -F_PX * u[:2] / u[2]
                t = (HEIGHT / 2 - y) / HEIGHT * READOUT_S
            if abs(x) < WIDTH / 2 and abs(y) < HEIGHT / 2:
                rows.append((i, p, x, y, t))
    table = np.array(rows)
    xy = table[:, 2:4] + rng.normal(0, NOISE_PX, (len(table), 2))
    ids, points = np.array([f"i{k:02d}" for k in range(len(at))]), np.array([f"p{k:03d}" for k in range(len(ground))])
    at_m = np.array(at)
    corner = [
        int(np.argmin(np.hypot(*(ground[:, :2] - c).T))) for c in ((0, 10), (60, 110), (0, 110), (60, 10), (30, 60))
    ]
    block = block_of(
        name="rolling",
        cameras={
            "id": ["c"], "kind": "digital", "image_coordinates": "photo", "pixel_size_mm": np.full((1, 2), PIXEL_MM),
            "format": np.array([[WIDTH, HEIGHT]]), "principal_distance_mm": F_PX * PIXEL_MM,
        },
        images={"id": ids, "camera": np.full(len(ids), "c"), "time_s": np.array(time)},
        image_points={
            "image": ids[table[:, 0].astype(int)], "point": points[table[:, 1].astype(int)], "xy": xy * PIXEL_MM,
            "sigma_mm": NOISE_PX * PIXEL_MM, "row_time_s": table[:, 4],
        },
        ground_points={
            "point": points[corner], "xyz_m": ground[corner], "covariance_m2": 1e-4 * np.tile(np.eye(3), (5, 1, 1)),
            "role": np.full((5, 3), CONTROL),
        },
        exterior={
            "image": ids, "position_m": at_m + rng.normal(0, 0.02, at_m.shape), "position_use": 1,
            "position_covariance_m2": np.tile(0.02**2 * np.eye(3), (len(ids), 1, 1)),
        },
    )  # fmt: skip
    return block, at_m


def _adjusted(block: Block, **options: object) -> Solution:
    return bundle(block, calibrated(block), _start(block), options=BundleOptions(**options))  # type: ignore[arg-type]


def _start(block: Block) -> Solution:
    from aatri.stages.initial_orientation.graph import graph

    return graph(block, calibrated(block), rng=np.random.default_rng(1))


@pytest.mark.slow
def test_positions_and_heights_are_those_of_the_flight() -> None:
    block, position = _flown()
    with_times = _adjusted(block)
    assert 0.9 < with_times.sigma0 < 1.1
    off = with_times.images.position_m - position
    assert np.sqrt((off**2).mean()) < 0.03
    at_once = replace(
        block, image_points=replace(block.image_points, row_time_s=np.full(len(block.image_points), np.nan))
    )
    without = _adjusted(at_once)
    assert without.sigma0 > 1.3  # SPEED x READOUT = 0.48 m on the ground, 11 px from the first row to the last


@pytest.mark.slow
def test_a_readout_that_is_not_known_is_found() -> None:
    block, _ = _flown()
    stated = replace(block, image_points=replace(block.image_points, row_time_s=1.25 * block.image_points.row_time_s))
    for sigma, within in ((None, 4.0), (0.5, 4.0)):
        found = _adjusted(stated, readout_sigma=sigma)
        row = np.flatnonzero(found.parameters.group == "rolling shutter")
        assert len(row) == 1
        value, sigma_found = found.parameters.value[row[0]], found.parameters.sigma[row[0]]
        assert abs(value - 0.8) < max(within * sigma_found, 0.005)
        assert sigma_found < 0.05
        assert found.sigma0 < 1.1


@pytest.mark.slow
def test_velocities_that_neighbours_do_not_tell_are_weighted_unknowns() -> None:
    block, _ = _flown(gusts_m_s=1.0)
    as_steps, weighted = (_adjusted(block, readout_sigma=None, velocity_sigma=sigma) for sigma in (0.0, 1.0))
    assert as_steps.sigma0 > 1.1
    assert 0.95 < weighted.sigma0 < 1.05
    row = np.flatnonzero(weighted.parameters.group == "rolling shutter")[0]
    assert abs(weighted.parameters.value[row] - 1) < 3 * weighted.parameters.sigma[row]
    assert weighted.parameters.sigma[row] < 0.05


def test_images_without_a_time_are_named() -> None:
    block, _ = _flown()
    time = block.images.time_s.copy()
    time[3] = np.nan
    with pytest.raises(InputError, match="no velocity for images i03"):
        _adjusted(replace(block, images=replace(block.images, time_s=time)))
