"""A legal block through all stages, within this process; and what must hold of the end.

An end is one of

    good            a result, and nothing speaks against it
    aside           images that a thing wrong has cut off are left out by name, and the rest is good
    refused         an error of aatri's, where a dense network says that the datum is open, or the whole is weak
    told            a result that its truth contradicts, or that lost good observations, with a warning
    INTERNAL        an error that is none of aatri's
    LOST            an error, or an image not oriented, where a dense network determines them
    OPEN            a result where nothing was determined
    WRONG           a result that its truth contradicts, and not a word
    REJECTED        good observations lost beyond 0.3 %

The truth contradicts a result where an adjusted point is off by more than its covariance allows: chi-square of three,
the largest of n points at 1 - LEVEL / n; and the mean of all by a band that holds
for any correlation (`mean_band`).
"""

from __future__ import annotations

import re
import tempfile
import traceback
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.stats import chi2

from aatri.artifacts.block import Block
from aatri.artifacts.solution import Solution
from aatri.errors import AatriError
from aatri.progress import Silent
from aatri.stages.absolute_orientation.similarity import similarity
from aatri.stages.accuracy.evaluation import evaluation
from aatri.stages.block.tables import TablesOptions, tables
from aatri.stages.bundle_adjustment.bundle import BundleOptions, bundle
from aatri.stages.image_refinement.systematic import SystematicOptions, systematic
from aatri.stages.initial_orientation.graph import graph
from aatri.stages.interior_orientation.affine import affine
from aatri.stages.interior_orientation.calibrated import calibrated
from aatri.stages.relative_orientation.dependent import dependent
from aatri.stages.strip_adjustment.polynomial import polynomial
from aatri.stages.strip_formation.scale_transfer import scale_transfer
from aatri.tables.schema import Artifact
from tests.campaigns.legal.cell import Cell
from tests.campaigns.legal.flight import Scene, scene_of
from tests.campaigns.legal.folder import set_of, write_block
from tests.campaigns.legal.network import Network, network_of

LEVEL = 1e-4
"""False alarm of each test of a cell: 0.2 of 2,000 blocks and a test."""
FOUND = 8.0
"""A wrong control point or position of more standard deviations must be found: 4 sigma at a power of 1 - 3e-5."""
MOST_LOST = 0.003
CUT_OFF = ("few", "shuffled", "weak")
"""What may leave neighbours without a tie."""
BAD = ("INTERNAL", "LOST", "OPEN", "WRONG", "REJECTED")


@dataclass
class Ear(Silent):
    """A context that keeps the warnings."""

    warnings: list[str] = field(default_factory=list)
    stage: str = ""

    def log(self, message: str) -> None:
        """Not kept."""

    def warn(self, message: str) -> None:
        self.warnings.append(f"{self.stage}: {message}")

    def progress(self, done: int, total: int, what: str = "") -> None:
        """Not kept."""


@dataclass(frozen=True)
class End:
    """How a cell ended."""

    outcome: str
    why: str = ""
    warnings: tuple[str, ...] = ()
    lost: int = 0
    good: int = 0


def end_of(cell: Cell, way: str, network: Network | None = None) -> End:
    """Carry a cell through, and judge it."""
    scene = scene_of(cell)
    network = network or network_of(scene)
    ear = Ear()
    try:
        block = read(scene, ear)
        solution = through(cell, block, way, ear)["bundle"]
    except AatriError as error:
        must = (not len(network.images) or network.weak) and error.exit_code in (3, 4, 5)
        return End("refused" if must else "LOST", f"{ear.stage}, exit {error.exit_code}: {error}", tuple(ear.warnings))
    except Exception:
        return End("INTERNAL", f"{ear.stage}: " + "".join(traceback.format_exc(limit=-2)), tuple(ear.warnings))
    assert isinstance(solution, Solution)
    return judged(scene, network, block, solution, tuple(ear.warnings))


def read(scene: Scene, ear: Ear) -> Block:
    """The block as aatri reads it from its folder."""
    with tempfile.TemporaryDirectory() as folder:
        write_block(scene, Path(folder))
        return tables(options=TablesOptions(path=Path(folder)), context=ear)


def through(cell: Cell, block: Block, way: str, ear: Ear) -> dict[str, Artifact]:
    """Results of all stages of the default chain, or of those for images without order, by their names."""
    made: dict[str, Artifact] = {"block": block}

    def make(name: str, stage: Callable[..., Artifact], *ports: str, **options: Any) -> None:
        ear.stage = name
        made[name] = stage(*(made[port] for port in ports), **options, context=ear)

    make("interior", affine if cell.camera == "film" else calibrated, "block")
    left_to_bundle = cell.parameters == "free"
    make("refined", systematic, "block", "interior", options=SystematicOptions(distortion=not left_to_bundle))
    if way == "graph":
        make("initial", graph, "block", "refined", rng=np.random.default_rng(cell.seed))
    else:
        make("models", dependent, "block", "refined")
        make("strips", scale_transfer, "block", "models")
        make("absolute", similarity, "block", "strips", "refined")
        make("initial", polynomial, "block", "refined", "strips", "absolute")
    removable = {"self_calibration": {"set": set_of(cell), "remove": True}} if cell.parameters == "removable" else {}
    make("bundle", bundle, "block", "refined", "initial", options=BundleOptions.model_validate(removable))
    make("accuracy", evaluation, "block", "bundle")
    return made


def judged(scene: Scene, network: Network, block: Block, solution: Solution, warnings: tuple[str, ...]) -> End:
    """What speaks against a result."""
    if not len(network.images) and not len(network_of(scene, taken_in=True).images):
        return End("OPEN", "a result of a block whose datum is open", warnings)
    lost, good = lost_of(scene, block, solution)
    far_id = scene.point_ids[scene.far_point]
    if scene.far_point >= 0 and not any(re.search(rf"\b{far_id}\b", text) for text in warnings):
        return End("WRONG", "a point at infinity has coordinates, and not a word", warnings, lost, good)
    decidable = network.size > FOUND or not (len(scene.wrong_control) + len(scene.wrong_positions))
    against = contradiction(scene, network, block, solution) if decidable else ""
    if against:
        return End("told" if warnings else "WRONG", against, warnings, lost, good)
    if scene.cell.factor < 1 and scene.cell.sigmas_of in ("image", "all") and not warnings:
        return End("WRONG", "not a word of standard deviations that are too small", warnings, lost, good)
    if lost > max(1, MOST_LOST * good):
        return End("REJECTED", f"{lost} of {good} good observations left out", warnings, lost, good)
    missing = [scene.image_ids[k] for k in network.images if k != scene.wrong_image]
    missing = [name for name in missing if not solution.images.oriented[block.images.id == name].all()]
    if missing:
        named = scene.cell.wrong in CUT_OFF and all(any(name in text for text in warnings) for name in missing[:1])
        return End("aside" if named else "LOST", f"not oriented: {', '.join(missing)}", warnings, lost, good)
    return End("good", "", warnings, lost, good)


def contradiction(scene: Scene, network: Network, block: Block, solution: Solution) -> str:
    """Points off by more than their covariances allow; empty if none are."""
    row = {name: k for k, name in enumerate(block.points.id.tolist())}
    points = np.setdiff1d(network.points, [*doubtful(scene), scene.far_point])
    points = points[[scene.point_ids[p] in row for p in points]]
    at = np.array([row[scene.point_ids[p]] for p in points])
    d, C = solution.points.xyz_m[at] - scene.xyz_m[points], solution.points.covariance_m2[at]
    known = (
        np.isfinite(d).all(axis=1) & np.isfinite(C).all(axis=(1, 2)) & (np.linalg.eigvalsh(np.nan_to_num(C))[:, 0] > 0)
    )
    if not known.any():
        return "no point has coordinates and covariance"
    square = np.einsum("ni,ni->n", d[known], np.linalg.solve(C[known], d[known][..., None])[..., 0])
    largest, factor = int(np.argmax(square)), scene.cell.factor
    limit = chi2.isf(LEVEL / len(square), 3)
    if square[largest] * factor**2 > limit:
        name = scene.point_ids[points[known][largest]]
        off = np.round(d[known][largest], 3)
        return f"{name} off by {off} m: chi-square {square[largest]:.0f}, limit {limit / factor**2:.0f}"
    low, high = mean_band()
    if not (low < square.mean() / 3 < high / factor**2):
        return f"mean chi-square of three {square.mean() / 3:.2f}, {low:.2f} to {high / factor**2:.2f}"
    return ""


def doubtful(scene: Scene) -> npt.NDArray[np.int64]:
    """Points of which nothing tells what is wrong: fewer than three right rays, or not more right ones than wrong."""
    n = len(scene.xyz_m)
    wrong = np.bincount(scene.true_rays.point[scene.wrong_rays], minlength=n)
    right = np.bincount(scene.true_rays.point, minlength=n) - wrong
    return np.flatnonzero((wrong > 0) & ((right < 3) | (right <= wrong)))


@cache
def mean_band() -> tuple[float, float]:
    """Band of the mean of chi-squares of three over 3, whatever their correlation, LEVEL on each side.

    P(mean > t) <= E (X - s)+ / (t - s) for any s: the mean is less than X in convex order. As x times the density of
    three degrees of freedom is 3 times that of five, E (X - s)+ = 3 P5(X > s) - s P3(X > s).
    """
    s = np.linspace(0.01, 60, 400)
    above = 3 * chi2.sf(s, 5) - s * chi2.sf(s, 3)
    below = s * chi2.cdf(s, 3) - 3 * chi2.cdf(s, 5)
    return float(np.max(s - below / LEVEL)) / 3, float(np.min(s + above / LEVEL)) / 3


def lost_of(scene: Scene, block: Block, solution: Solution) -> tuple[int, int]:
    """Good observations that stay out, and all good ones; not counted are rays of doubtful points."""
    wrong = {
        (scene.image_ids[scene.true_rays.image[k]], scene.point_ids[scene.true_rays.point[k]]) for k in scene.wrong_rays
    }
    of_doubtful = {scene.point_ids[p] for p in doubtful(scene)} | {f"p{scene.far_point + 1}"}
    innocent = 0
    for kind, image, point in _left_out(solution):
        if kind == "control" and point in [scene.point_ids[p] for p in scene.control[scene.wrong_control]]:
            continue
        if kind == "position" and image in [scene.image_ids[k] for k in scene.positioned[scene.wrong_positions]]:
            continue
        if kind == "image_point" and ((image, point) in wrong or point in of_doubtful):
            continue
        innocent += 1
    good = len(scene.xy_mm) - len(wrong) + len(scene.control) + len(scene.positioned)
    return innocent, good


def _left_out(solution: Solution) -> set[tuple[str, str, str]]:
    s = solution.suspects
    out = s.staying_out & ~np.isin(s.kind, ("model_tie", "strip_tie"))  # of the stages before, made of image points
    return set(zip(s.kind[out].tolist(), s.image[out].tolist(), s.point[out].tolist()))
