"""Row 97: All lens parameters free in a small block."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.flown import digital, said

FREE = "principal_distance: .inf, principal_point: [.inf, .inf], " + ", ".join(
    f"{name}: .inf" for name in ("k1", "k2", "k3", "p1", "p2", "b1", "b2")
)


def make(folder: Path) -> list[str] | None:
    digital(folder, said("sigmas: {}", f"sigmas: {{{FREE}}}"), refined="distortion: false")
    return None
