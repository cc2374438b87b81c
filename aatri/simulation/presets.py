"""Presets of simulated blocks: sets of values laid under those the user gives."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

_UAV_CAMERA: Mapping[str, Any] = {
    "id": "frame20", "kind": "digital", "principal_distance_mm": 8.8, "principal_point_mm": (0.012, -0.008),
    "format": (5472.0, 3648.0), "pixel_size_mm": 0.0024, "distortion": "brown", "mounting_deg": 90,
    "brown": {"k1": 2.0e-5, "k2": -1.5e-7, "p1": 2.0e-6, "p2": -1.0e-6}, "margin_mm": 0.05,
}  # fmt: skip
_UAV_FLIGHT: Mapping[str, Any] = {
    "position_sigma_m": (0.5, 0.5, 0.5), "tilt_sigma_deg": 1.0, "tilt_max_deg": 4.0, "kappa_sigma_deg": 2.0,
    "speed_m_per_s": 10.0,
}  # fmt: skip
_UAV_NOISE: Mapping[str, Any] = {
    "image_um": 1.2, "control_m": (0.01, 0.01, 0.015), "gnss_m": (0.03, 0.03, 0.03),
}  # fmt: skip

PRESETS: Mapping[str, Mapping[str, Any]] = {
    "rc30": {
        "name": "rc30",
        "camera": {
            "id": "rc30", "kind": "film", "principal_distance_mm": 153.84, "principal_point_mm": (0.011, 0.002),
            "format": (230.0, 230.0), "fiducials": 4, "distortion": "brown",
            "brown": {"k1": 5.0e-9, "k2": -2.2e-13, "p1": 5.0e-8, "p2": -3.0e-8},
        },
        "flight": {
            "strips": 9, "images_per_strip": 25, "cross_strips": 2, "forward_overlap": 61.0, "side_overlap": 32.0,
            "scale_number": 2500.0,
        },
        "terrain": {"mean_height_m": 6.0, "relief_m": 15.0},
        "ties": {"per_position": 6, "new_points": 3632},
        "known": {"full": 72, "check_full": 36},
        "earth": "map", "false_origin_m": (446000.0, 4505000.0), "refraction": "radial",
        "noise": {"image_um": 5.0, "fiducial_um": 2.0, "control_m": (0.01, 0.01, 0.015), "gnss_m": (0.05, 0.05, 0.05)},
    },
    "uav": {
        "name": "uav",
        "camera": {
            "id": "frame20", "kind": "digital", "principal_distance_mm": 8.8, "principal_point_mm": (0.012, -0.008),
            "format": (5472.0, 3648.0), "pixel_size_mm": 0.0024, "distortion": "brown", "mounting_deg": 90,
            "brown": {"k1": 2.0e-5, "k2": -1.5e-7, "p1": 2.0e-6, "p2": -1.0e-6}, "margin_mm": 0.05,
        },
        "flight": {
            "strips": 8, "images_per_strip": 25, "forward_overlap": 80.0, "side_overlap": 60.0,
            "scale_number": 11400.0, "position_sigma_m": (0.5, 0.5, 0.5), "tilt_sigma_deg": 1.0, "tilt_max_deg": 4.0,
            "kappa_sigma_deg": 2.0, "speed_m_per_s": 10.0,
        },
        "terrain": {"mean_height_m": 120.0, "relief_m": 8.0, "wavelength_m": 200.0},
        "ties": {"per_position": 0, "random_per_image": 300.0},
        "known": {"full": 9, "check_full": 16},
        "earth": "map", "refraction": "radial",
        "noise": {"image_um": 1.2, "control_m": (0.01, 0.01, 0.015), "gnss_m": (0.03, 0.03, 0.03)},
    },
    "orbit": {
        "name": "orbit",
        "camera": {**_UAV_CAMERA, "mounting_deg": 0},
        "flight": {
            **_UAV_FLIGHT, "arrangement": "orbit", "strips": 2, "images_per_strip": 18, "scale_number": 9000.0,
        },
        "terrain": {"mean_height_m": 120.0, "relief_m": 12.0, "wavelength_m": 30.0},
        "ties": {"per_position": 0, "new_points": 600},
        "known": {"full": 6, "check_full": 6}, "gnss": {"observed": False, "approximate_positions": False},
        "earth": "flat", "refraction": "none", "noise": _UAV_NOISE,
    },
    "oblique": {
        "name": "oblique",
        "camera": _UAV_CAMERA,
        "flight": {
            **_UAV_FLIGHT, "strips": 3, "images_per_strip": 5, "forward_overlap": 75.0, "side_overlap": 65.0,
            "scale_number": 11400.0, "five_heads_deg": 40.0,
        },
        "terrain": {"mean_height_m": 120.0, "relief_m": 8.0, "wavelength_m": 100.0},
        "ties": {"per_position": 0, "new_points": 3000},
        "known": {"full": 9, "check_full": 9}, "gnss": {"observed": False, "approximate_positions": False},
        "earth": "flat", "refraction": "none", "noise": _UAV_NOISE,
    },
    "hover": {
        "name": "hover",
        "camera": _UAV_CAMERA,
        "flight": {
            **_UAV_FLIGHT, "arrangement": "hover", "strips": 9, "images_per_strip": 4, "forward_overlap": 65.0,
            "scale_number": 11400.0, "position_sigma_m": (0.3, 0.3, 0.3), "kappa_sigma_deg": 40.0,
        },
        "terrain": {"mean_height_m": 120.0, "relief_m": 8.0, "wavelength_m": 100.0},
        "ties": {"per_position": 0, "new_points": 900},
        "known": {"full": 6, "check_full": 6}, "gnss": {"observed": False, "approximate_positions": False},
        "earth": "flat", "refraction": "none", "noise": _UAV_NOISE,
    },
    "test_field": {
        "name": "test_field",
        "camera": {
            "id": "close", "kind": "digital", "principal_distance_mm": 24.0, "principal_point_mm": (0.05, -0.08),
            "format": (6000.0, 4000.0), "pixel_size_mm": 0.006, "distortion": "brown", "margin_mm": 0.1,
            "brown": {"k1": 3.0e-5, "k2": -4.0e-8, "p1": 5.0e-6, "p2": -4.0e-6, "b1": 1.0e-4, "b2": -5.0e-5},
            "distortion_known": False,
        },
        "flight": {
            "arrangement": "orbit", "strips": 3, "images_per_strip": 12, "scale_number": 200.0,
            "orbit_elevations_deg": (35.0, 75.0), "orbit_rolls": True, "orbit_share": 0.75,
            "kappa_sigma_deg": 1.0, "tilt_sigma_deg": 2.0, "tilt_max_deg": 6.0, "position_sigma_m": (0.1, 0.1, 0.1),
            "speed_m_per_s": 0.1,
        },
        "terrain": {"mean_height_m": 0.0, "relief_m": 0.8, "wavelength_m": 0.8},
        "ties": {"per_position": 0, "new_points": 80},
        "known": {"full": 20, "check_full": 20}, "gnss": {"observed": False, "approximate_positions": False},
        "earth": "flat", "refraction": "none",
        "noise": {"image_um": 0.6, "control_m": (2.0e-5, 2.0e-5, 3.0e-5)},
    },
    "sample": {  # the block by which the lecture notes count observations and unknowns
        "name": "sample",
        "camera": {
            "id": "metric", "kind": "digital", "principal_distance_mm": 153.0, "principal_point_mm": (0.0, 0.0),
            "format": (11500.0, 11500.0), "pixel_size_mm": 0.02, "distortion": "none",
        },
        "flight": {
            "strips": 3, "images_per_strip": 5, "forward_overlap": 60.0, "side_overlap": 30.0, "scale_number": 10000.0,
            "position_sigma_m": (0.0, 0.0, 0.0), "tilt_sigma_deg": 0.3, "tilt_max_deg": 0.6, "kappa_sigma_deg": 0.3,
        },
        "terrain": {"mean_height_m": 50.0, "relief_m": 20.0},
        "known": {"layout": ("XoXoX", "ooooo", "XoZoX", "ooooo", "XoZoX", "ooooo", "XoXoX")},
        "gnss": {"observed": False, "approximate_positions": True},
        "earth": "flat", "refraction": "radial", "noise": {"image_um": 10.0, "control_m": (0.0, 0.0, 0.0)},
    },
}  # fmt: skip
"""Values laid under the user's own."""
