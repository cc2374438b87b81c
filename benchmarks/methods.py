"""Every variant of every role times every other that fits, on simulated blocks with truth: one table.

    python benchmarks/methods.py                      prints the table of both blocks
    python benchmarks/methods.py docs/method_table.md writes it

Each combination interior orientation x relative orientation x strip formation x adjustment of strips or models runs
once; what it shares with others is made once. Bundles follow on the usual chain, on each adjustment and on other
starts. For every variant: in how many combinations it ran, RMS of plan and height of the new points against the truth
over them (median and worst), their theory, seconds of the stage itself. What was refused is listed with the reason.
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
        "preset": "rc30",
        "earth": "tangent",
        "false_origin_m": (0.0, 0.0),
        "camera": {"fiducials": 8},
        "flight": {"strips": 3, "images_per_strip": 6, "cross_strips": 1},
        "ties": {"new_points": 300},
        "known": {"full": 16, "check_full": 0},
    },
    "UAV, 3 strips of 8 images": {
        "preset": "uav",
        "earth": "tangent",
        "flight": {"strips": 3, "images_per_strip": 8},
        "ties": {"random_per_image": 60.0},
        "known": {"full": 16, "check_full": 0},
    },
}
ROLES = ("interior_orientation", "relative_orientation", "strip_formation")
LAST = ("strip_adjustment", "model_adjustment")
BUNDLES = ("bundle", "alternating", "resection", "intersection")
ORDER = (*ROLES, *LAST, "absolute", "initial", "image", "bundle")
OPTIONS: list[tuple[str, dict[str, Any] | None]] = [
    ("relative_orientation/dependent", {"equation": "q"}),
    ("strip_formation/scale_transfer", {"estimator": "mean"}),
    ("strip_adjustment/polynomial", {"degree": 3}),
    ("strip_adjustment/conformal", {"degree": 3}),
    ("model_adjustment/independent_models", {"centres": 0.05}),
    ("model_adjustment/independent_models", {"iteration": "plan_height"}),
]
"""Options that are methods of their own, beside the defaults."""

WEIGHTED: list[tuple[str, dict[str, Any] | None]] = [("bundle_adjustment/resection", {"points": "weighted"})]


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

    def run(self, name: str, *inputs: Any, options: dict[str, Any] | None = None, **more: Any) -> Any:
        """The artifact, or None where it was refused or an input is missing."""
        label = named(name, options)
        key = (label, *map(id, inputs))
        if any(i is None for i in inputs):
            return None
        if key not in self.made:
            card, began = self.registry.card(name), time.perf_counter()
            if options is not None and card.options is not None:
                more["options"] = card.options.model_validate(options)
            try:
                self.made[key] = (card.function(*inputs, **more), inputs)
                self.seconds[label].append(time.perf_counter() - began)
            except AatriError as error:
                self.refused[label].add(str(error.what).split("\n")[0])
                self.made[key] = (None, inputs)
        return self.made[key][0]


def named(name: str, options: dict[str, Any] | None = None) -> str:
    """A variant with the options that are not its own defaults."""
    return name + "".join(f", {option} {value}" for option, value in (options or {}).items())


def errors(block: Any, solution: Any) -> tuple[float, ...]:
    """RMS of plan and height of the new points against the truth, and of their standard deviations, m."""
    truth = block.true_points
    X = np.full((len(block.points), 3), np.nan)
    X[truth.point] = truth.xyz_m
    X[block.ground_points.point] = np.nan
    e = solution.points.xyz_m - X
    known = np.isfinite(e).all(axis=1)
    variance = np.einsum("nii->ni", solution.points.covariance_m2)[known]
    square = [(e[known] ** 2).mean(axis=0), np.nan_to_num(variance, nan=np.inf).mean(axis=0)]
    return tuple(float(np.sqrt(f)) for q in square for f in (q[:2].mean(), q[2]))


def combinations(runs: Runs, block: Any) -> Iterator[tuple[list[str], Any]]:
    """All chains up to the adjustment of strips or models, and the bundles: names to be counted, and the result."""
    lists = [[(n, None) for n in runs.variants(role)] + [o for o in OPTIONS if o[0].startswith(role)] for role in ROLES]
    digital = bool((block.cameras.kind == "digital").all())
    lists[0] = [o for o in lists[0] if o[0].endswith("/calibrated") == digital]
    last = [(n, None) for role in LAST for n in runs.variants(role)] + [o for o in OPTIONS if o[0].startswith(LAST)]
    for interior, relative, strip in itertools.product(*lists):
        points = runs.run("image_refinement/systematic", block, runs.run(interior[0], block))
        models = runs.run(relative[0], block, points, options=relative[1])
        if strip[0].endswith("/connected") and not relative[0].endswith("/connected"):
            continue  # takes the scales of connected models
        strips = runs.run(strip[0], block, models, options=strip[1])
        absolute = runs.run("absolute_orientation/similarity", block, strips, points)
        usual = interior[0].endswith(("affine", "calibrated")) and relative == ("relative_orientation/dependent", None)
        chain = [named(*interior), named(*relative), named(*strip)]
        for name, options in last:
            given = models if name.startswith("model") else strips
            adjusted = runs.run(name, block, points, given, absolute, options=options)
            yield [*chain, named(name, options)], adjusted
            if usual and strip == ("strip_formation/scale_transfer", None) and options is None:
                yield from bundles(runs, block, points, adjusted)
        if usual and strip == ("strip_formation/scale_transfer", None):
            yield from starts(runs, block, points, absolute)


def starts(runs: Runs, block: Any, points: Any, absolute: Any) -> Iterator[tuple[list[str], Any]]:
    """Orientations without adjustment of strips or models, with the bundles on them; refinements that need a bundle."""
    yield ["absolute_orientation/similarity"], absolute
    yield from bundles(runs, block, points, absolute)
    direct = runs.run("absolute_orientation/direct", block, points)
    yield ["absolute_orientation/direct"], direct
    if direct is not None:
        yield from bundles(runs, block, points, direct)
    graph = runs.run("initial_orientation/graph", block, points, rng=np.random.default_rng(1))
    yield ["initial_orientation/graph"], graph
    yield from bundles(runs, block, points, graph)
    first = runs.run("bundle_adjustment/bundle", block, points, absolute)
    second = runs.run("image_refinement/collocation", block, points, first)
    yield ["image_refinement/collocation"], runs.run("bundle_adjustment/bundle", block, second, absolute)
    calibrated = runs.run("bundle_adjustment/bundle", block, points, absolute, options={"self_calibration": "ebner12"})
    yield ["bundle_adjustment/bundle, self_calibration ebner12"], calibrated
    second = runs.run("image_refinement/additional_parameters", block, points, calibrated)
    yield ["image_refinement/additional_parameters"], runs.run("bundle_adjustment/bundle", block, second, absolute)


def bundles(runs: Runs, block: Any, points: Any, initial: Any) -> Iterator[tuple[list[str], Any]]:
    """Every bundle on one start."""
    for name, options in [*((f"bundle_adjustment/{b}", None) for b in BUNDLES), *WEIGHTED]:
        if options and (initial is None or not np.isfinite(getattr(initial, next(iter(options))).covariance_m2).any()):
            continue
        yield [named(name, options)], runs.run(name, block, points, initial, options=options)


def table(title: str, options: dict[str, Any]) -> str:
    """The table of one block."""
    runs = Runs()
    card = runs.registry.card("block/simulate")
    assert card.options is not None
    block = card.function(options=card.options(**options), rng=np.random.default_rng(1))
    found: dict[str, list[tuple[float, ...]]] = defaultdict(list)
    tried: dict[str, int] = defaultdict(int)
    for names, solution in combinations(runs, block):
        for name in names:
            tried[name] += 1
            if solution is not None:
                found[name].append(errors(block, solution))
    lines = [
        f"### {title}",
        "",
        "| variant | ran | plan mm (worst) | height mm (worst) | theory mm: plan, height | s |",
        "|---|---|---|---|---|---|",
    ]
    for name in sorted(tried, key=lambda n: (next(k for k, role in enumerate(ORDER) if n.startswith(role)), n)):
        e = 1e3 * np.array(found[name]).reshape(-1, 4)
        told = ["", ""] if not len(e) else [f"{np.median(c):.1f} ({c.max():.1f})" for c in e[:, :2].T]
        theory = (
            ""
            if not len(e) or not np.isfinite(np.median(e[:, 2]))
            else "{:.1f}, {:.1f}".format(*np.median(e[:, 2:], 0))
        )
        seconds = f"{np.median(runs.seconds[name]):.2f}" if runs.seconds[name] else ""
        lines.append(f"| `{name}` | {len(e)} of {tried[name]} | {told[0]} | {told[1]} | {theory} | {seconds} |")
    refused = [f"- `{name}`: {why}" for name, reasons in runs.refused.items() for why in sorted(reasons)]
    return "\n".join([*lines, "", *(["Refused:", "", *refused] if refused else ["Nothing was refused."]), ""])


TITLE = "## Every method beside its neighbours"

HEAD = f"""{TITLE}

Made by `python benchmarks/methods.py docs/method_table.md`. Rows of the first three roles and of the adjustments of
strips and models: over all combinations with the variants of the other roles, the result is that of the adjustment of
strips or models. `strip_formation/connected` takes the scales of `relative_orientation/connected`, and no other models.
Rows of `bundle_adjustment`: on the usual chain and each of these adjustments, absolute orientation alone, observed
orientations where there are any, and `graph`. Rows of `image_refinement`: of the bundle that takes their image points.

RMS of new points against the truth, median over the combinations and worst; theory: RMS of their standard deviations,
where the method gives them. Resection gives the points of its start; intersection takes the images of its start as
exact, which its standard deviations leave out. Seconds of the stage alone, median, on a machine shared with others.
"""


def main() -> None:
    """Write or print the tables."""
    text = "\n".join([HEAD, *(table(title, options) for title, options in BLOCKS.items())])
    if len(sys.argv) > 1:
        page = Path(sys.argv[1])
        before = page.read_text(encoding="utf-8").partition(TITLE)[0] if page.exists() else ""
        page.write_text(before + text, encoding="utf-8")
    else:
        sys.stdout.write(text)


if __name__ == "__main__":
    main()
