"""Every variant of every role times every other that fits, on simulated blocks with truth: one table.

    python benchmarks/methods.py                      prints the table of both blocks
    python benchmarks/methods.py docs/method_table.md writes it

Each combination interior orientation x relative orientation x strip formation x adjustment of strips or models runs
once; what it shares with others is made once. Bundles follow on the usual chain and on each adjustment. For every
variant: in how many combinations it ran, RMS of plan and height of the new points against the truth over them (median
and worst), seconds of the stage itself. What was refused is listed with the reason.
"""

from __future__ import annotations

import itertools
import sys
import time
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from aatri.errors import AatriError
from aatri.pipeline.methods.registry import find_stages

BLOCKS: dict[str, dict[str, Any]] = {
    "demo, 3 + 1 strips of 6 film images": {
        "preset": "rc30", "earth": "tangent", "false_origin_m": (0.0, 0.0),
        "camera": {"fiducials": 8}, "flight": {"strips": 3, "images_per_strip": 6, "cross_strips": 1},
        "ties": {"new_points": 300}, "known": {"full": 16, "check_full": 0},
    },
    "UAV, 3 strips of 8 images": {
        "preset": "uav", "earth": "tangent", "flight": {"strips": 3, "images_per_strip": 8},
        "ties": {"random_per_image": 60.0}, "known": {"full": 16, "check_full": 0},
    },
}  # fmt: skip
ROLES = ("interior_orientation", "relative_orientation", "strip_formation")
LAST = ("strip_adjustment", "model_adjustment")
BUNDLES = ("bundle", "alternating", "resection", "intersection")


class Runs:
    """Stages run once for every set of inputs; seconds and failures kept."""

    def __init__(self) -> None:
        self.registry = find_stages()
        self.made: dict[tuple[Any, ...], Any] = {}
        self.seconds: dict[str, list[float]] = defaultdict(list)
        self.refused: dict[str, set[str]] = defaultdict(set)

    def variants(self, role: str) -> list[str]:
        """Variants of a role."""
        return sorted(name for name in self.registry.variants if name.startswith(f"{role}/"))

    def run(self, name: str, *inputs: Any) -> Any:
        """The artifact, or None where it was refused or an input is missing."""
        key = (name, *map(id, inputs))
        if any(i is None for i in inputs):
            return None
        if key not in self.made:
            began = time.perf_counter()
            try:
                self.made[key] = (self.registry.card(name).function(*inputs), inputs)
                self.seconds[name].append(time.perf_counter() - began)
            except AatriError as error:
                self.refused[name].add(str(error.what).split("\n")[0])
                self.made[key] = (None, inputs)
        return self.made[key][0]


def errors(block: Any, solution: Any) -> tuple[float, float]:
    """RMS of plan and height of the new points, m."""
    truth = block.true_points
    X = np.full((len(block.points), 3), np.nan)
    X[truth.point] = truth.xyz_m
    X[block.ground_points.point] = np.nan
    e = solution.points.xyz_m - X
    e = e[np.isfinite(e).all(axis=1)]
    return float(np.sqrt((e[:, :2] ** 2).sum(axis=1).mean() / 2)), float(np.sqrt((e[:, 2] ** 2).mean()))


def combinations(runs: Runs, block: Any) -> Iterator[tuple[dict[str, str], Any]]:
    """All chains up to the adjustment of strips or models, and the bundles."""
    lists = [runs.variants(role) for role in ROLES]
    if (block.cameras.kind == "digital").all():
        lists[0] = ["interior_orientation/calibrated"]
    else:
        lists[0].remove("interior_orientation/calibrated")
    last = [name for role in LAST for name in runs.variants(role)]
    for interior, relative, strip in itertools.product(*lists):
        points = runs.run("image_refinement/systematic", block, runs.run(interior, block))
        models = runs.run(relative, block, points)
        strips = runs.run(strip, block, models)
        absolute = runs.run("absolute_orientation/similarity", block, strips, points)
        usual = interior.endswith(("affine", "calibrated")) and relative.endswith("/dependent")
        chain = dict(zip(ROLES, (interior, relative, strip)))
        for name in last:
            given = models if name.startswith("model") else strips
            adjusted = runs.run(name, block, points, given, absolute)
            yield {**chain, "adjustment": name}, adjusted
            if usual and strip.endswith("scale_transfer"):
                for bundle in BUNDLES:
                    made = runs.run(f"bundle_adjustment/{bundle}", block, points, adjusted)
                    yield {"bundle_adjustment": f"bundle_adjustment/{bundle}", "adjustment": name}, made


def table(title: str, options: dict[str, Any]) -> str:
    """The table of one block."""
    runs = Runs()
    card = runs.registry.card("block/simulate")
    assert card.options is not None
    block = card.function(options=card.options(**options), rng=np.random.default_rng(1))
    found: dict[str, list[tuple[float, float]]] = defaultdict(list)
    tried: dict[str, int] = defaultdict(int)
    for names, solution in combinations(runs, block):
        of_bundle = "bundle_adjustment" in names
        for role, name in names.items():
            if of_bundle and role == "adjustment":
                continue
            tried[name] += 1
            if solution is not None:
                found[name].append(errors(block, solution))
    lines = [f"## {title}", "", "| variant | ran | plan mm, median (worst) | height mm, median (worst) | s, median |",
             "|---|---|---|---|---|"]  # fmt: skip
    for name in tried:
        e = 1e3 * np.array(found[name]).reshape(-1, 2)
        told = ["", ""] if not len(e) else [f"{np.median(c):.1f} ({c.max():.1f})" for c in e.T]
        seconds = f"{np.median(runs.seconds[name]):.2f}" if runs.seconds[name] else ""
        lines.append(f"| `{name}` | {len(e)} of {tried[name]} | {told[0]} | {told[1]} | {seconds} |")
    refused = [f"- `{name}`: {why}" for name, reasons in runs.refused.items() for why in sorted(reasons)]
    return "\n".join([*lines, "", *(["Refused:", "", *refused] if refused else ["Nothing was refused."]), ""])


HEAD = """# Every method beside its neighbours

Made by `python benchmarks/methods.py docs/method_table.md`. Rows of the first three roles and of the adjustments of
strips and models: over all combinations with the variants of the other roles, the result is that of the adjustment of
strips or models. Rows of `bundle_adjustment`: on the usual chain and each of these adjustments. RMS of new points
against the truth.
"""


def main() -> None:
    """Write or print the tables."""
    text = "\n".join([HEAD, *(table(title, options) for title, options in BLOCKS.items())])
    if len(sys.argv) > 1:
        Path(sys.argv[1]).write_text(text, encoding="utf-8")
    else:
        sys.stdout.write(text)


if __name__ == "__main__":
    main()
