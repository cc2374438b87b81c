"""How errors grow along a free strip: simulated strips against the laws of propagation, with a plot.

    python benchmarks/error_propagation.py                                    prints the table
    python benchmarks/error_propagation.py docs/error_propagation.svg         writes the plot too

Strips of digital images over gentle relief go through relative orientation and scale transfer. The free strip is laid
on the truth by its first model alone; the errors of the n-th model are those of its right projection centre. Studies:

- random (A601): errors of 10 um. Each model adds an error of rotation and scale of its own. Those add up as
  d1 + ... + dn, sigma sqrt(n), in the attitude; and twice, n d1 + (n - 1) d2 + ... + dn, in the place:
  sigma_b sqrt(n (n + 1)(2n + 1) / 6), about sigma_b n^1.5 / sqrt(3). sigma is fitted to all n at once.
- constant (A602): no errors but a radial distortion (20 um at 100 mm) that nobody corrects, the same in each model:
  what it turns and scales in one model adds up to a parabola of heights, and dX grows from model to model.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np

from aatri.arrays import Float
from aatri.geometry.rotations import log_rotation
from aatri.stages.block.simulate import SimulateOptions, simulate
from aatri.stages.interior_orientation.calibrated import calibrated
from aatri.stages.relative_orientation.dependent import dependent
from aatri.stages.strip_formation.scale_transfer import scale_transfer

MODELS = 24
STRIPS = 30


def one_strip(seed: int, *, noise: bool, lens: float) -> tuple[Float, Float]:
    """Errors of place, in bases (n, 3), and of attitude, rad (n, 3), of a free strip laid on its first model."""
    options: dict[str, Any] = {
        "preset": "sample", "flight": {"strips": 1, "images_per_strip": MODELS + 1}, "known": {"layout": (), "full": 4},
        "ties": {"per_position": 3}, "refraction": "none", "noise": {"factor": float(noise)},
        "camera": {"distortion": "brown", "brown": {"k1": lens}},
    }  # fmt: skip
    block = simulate(options=SimulateOptions(**options), rng=np.random.default_rng(seed))
    points = calibrated(block)  # the lens is left as it is
    strips = scale_transfer(block, dependent(block, points))
    table, truth = strips.strip_images, block.true_images
    assert truth is not None
    order = np.argsort(block.images.sequence[table.image], kind="stable")
    image = table.image[order]
    X, R = truth.position_m[image], truth.ground_from_image[image]
    base = float(np.linalg.norm(X[1] - X[0]))
    turn = R[0] @ table.strip_from_image[order[0]].T
    x = (table.position[order] - table.position[order[0]]) @ turn.T
    x *= base / np.linalg.norm(x[1])
    angle = log_rotation(turn @ table.strip_from_image[order] @ R.swapaxes(1, 2))
    return (x - (X - X[0])) / base, angle


def rms(values: list[Float]) -> Float:
    """Root mean square over the strips."""
    return np.asarray(np.sqrt((np.stack(values) ** 2).mean(axis=0)))


def study() -> tuple[str, dict[str, Float]]:
    """The table, and what is drawn: by n, heights and their law, constant errors."""
    made = [one_strip(seed, noise=True, lens=0.0) for seed in range(1, STRIPS + 1)]
    place, attitude = rms([p for p, _ in made])[1:], rms([a for _, a in made])[1:]
    n = np.arange(1, MODELS + 1)
    walk, double = np.sqrt(n), np.sqrt(n * (n + 1) * (2 * n + 1) / 6)
    phi, height = attitude[:, 1], place[:, 2]
    s_phi, s_z = (float((law * v).sum() / (law * law).sum()) for law, v in ((walk, phi), (double, height)))
    constant, _ = one_strip(1, noise=False, lens=2e-8)
    lines = ["| n | phi mrad | sigma sqrt(n) | height, bases / 1000 | sigma_b sqrt(n(n+1)(2n+1)/6) | "
             "constant: dX | dZ |",
             "|---|---|---|---|---|---|---|"]  # fmt: skip
    for k in (0, 1, 3, 5, 7, 11, 15, 19, 23):
        c = 1e3 * constant[k + 1]
        cells = [1e3 * phi[k], 1e3 * s_phi * walk[k], 1e3 * height[k], 1e3 * s_z * double[k], c[0], c[2]]
        lines.append(f"| {n[k]} | " + " | ".join(f"{v:.3f}" for v in cells) + " |")
    slope = float(np.polyfit(np.log(n[3:]), np.log(height[3:]), 1)[0])
    lines += ["", f"{STRIPS} strips of {MODELS} models; heights grow like n^{slope:.2f} from n = 4 on (law: n^1.5)."]
    return "\n".join(lines), {"measured": 1e3 * height, "law": 1e3 * s_z * double, "constant dZ": 1e3 * constant[1:, 2],
                              "constant dX": 1e3 * constant[1:, 0]}  # fmt: skip


def svg(curves: dict[str, Float], width: int = 640, height: int = 360) -> str:
    """The curves over n, each panel to its own scale."""
    colours = ("#1b6ca8", "#888888", "#b3541e", "#3a7d44")
    panels = [("height of random errors, bases / 1000", ("measured", "law")),
              ("constant error, bases / 1000", ("constant dZ", "constant dX"))]  # fmt: skip
    parts = [f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" font-family="sans-serif" '
             'font-size="12">']  # fmt: skip
    colour = iter(colours)
    for k, (title, names) in enumerate(panels):
        left, wide, top, high = 50 + k * width / 2, width / 2 - 70, 40, height - 90
        values = np.concatenate([curves[n] for n in names])
        low, most = min(float(values.min()), 0.0), max(float(values.max()), 1e-9)
        parts.append(f'<text x="{left}" y="24">{title}</text>')
        parts.append(f'<rect x="{left}" y="{top}" width="{wide}" height="{high}" fill="none" stroke="#999"/>')
        for value in (low, most):
            y = top + high * (1 - (value - low) / (most - low))
            parts.append(f'<text x="{left - 4}" y="{y + 4:.1f}" text-anchor="end">{value:.2f}</text>')
        parts.append(
            f'<text x="{left + wide / 2}" y="{top + high + 18}" text-anchor="middle">model 1 to {MODELS}</text>'
        )
        for row, name in enumerate(names):
            c, v = next(colour), curves[name]
            x = left + wide * np.arange(len(v)) / (len(v) - 1)
            y = top + high * (1 - (v - low) / (most - low))
            points = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x, y))
            parts.append(f'<polyline points="{points}" fill="none" stroke="{c}" stroke-width="2"/>')
            free = top + 18 if -low < most else top + high - 8 - 16 * (len(names) - 1)  # the corner without curves
            parts.append(f'<text x="{left + 8}" y="{free + 16 * row}" fill="{c}">{name}</text>')
    return "\n".join([*parts, "</svg>", ""])


def main() -> None:
    """Print the table; write the plot."""
    text, curves = study()
    sys.stdout.write(text + "\n")
    if len(sys.argv) > 1:
        Path(sys.argv[1]).write_text(svg(curves), encoding="utf-8")


if __name__ == "__main__":
    main()
