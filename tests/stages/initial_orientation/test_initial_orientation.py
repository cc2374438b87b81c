"""Images of any arrangement, oriented without strips, order or start values."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from aatri.artifacts.block import Block, Geodetic
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.solution import Solution
from aatri.formats.tables.reader import read_block
from aatri.stages.accuracy.evaluation import evaluation
from aatri.stages.block.simulate import SimulateOptions, simulate
from aatri.stages.bundle_adjustment.bundle import BundleOptions, bundle
from aatri.stages.image_refinement.systematic import SystematicOptions, systematic
from aatri.stages.initial_orientation.graph import GraphOptions, graph
from aatri.stages.interior_orientation.calibrated import calibrated
from aatri.stages.relative_orientation.essential import essential
from tests.made_uav_3strips import block_folder


def measured(block: Block) -> ImagePoints:
    return systematic(block, calibrated(block), options=SystematicOptions(refraction=False))


@pytest.mark.slow
def test_three_oblique_strips_are_oriented_without_strips_order_or_start(shared_data: Path, tmp_path: Path) -> None:
    block = read_block(block_folder(shared_data / "uav_3strips", tmp_path / "block"))
    assert not len(block.strips)
    points = measured(block)
    initial = graph(block, points, rng=np.random.default_rng(1))
    assert initial.images.oriented.all()
    done = bundle(block, points, initial, options=BundleOptions(blunders={"method": "robust_snooping"}))
    found = evaluation(block, done).metrics()
    # Nothing is published of this block: the check points are known to 3 cm.
    assert found["check_points"] == 11
    assert max(found[f"check_rmse_{axis}_m"] or 1.0 for axis in "xyz") < 0.06


@pytest.mark.slow
def test_without_control_the_datum_is_free_and_the_first_base_is_one(shared_data: Path, tmp_path: Path) -> None:
    block = read_block(block_folder(shared_data / "uav_3strips", tmp_path / "block"))
    block = replace(block, ground_points=block.ground_points.take(np.zeros(0, dtype=np.intp)))
    initial = graph(block, measured(block), options=GraphOptions(pairs_per_image=6), rng=np.random.default_rng(1))
    assert initial.datum is not None
    centre = initial.images.position_m
    assert np.linalg.norm(centre[1] - centre[0]) == pytest.approx(1.0, rel=1e-12)
    assert initial.images.oriented.all()


def simulated(seed: int = 1, **given: object) -> Block:
    return simulate(options=SimulateOptions.model_validate(given), rng=np.random.default_rng(seed))


def without_strips(block: Block) -> Block:
    """The same block as unordered images."""
    n = len(block.images)
    images = replace(block.images, strip=np.full(n, -1, dtype=np.int32), sequence=np.full(n, np.nan))
    return replace(block, images=images, strips=block.strips.take(np.zeros(0, dtype=np.intp)))


def initial_of(block: Block, **options: object) -> Solution:
    points = systematic(block, calibrated(block), options=SystematicOptions(refraction=False, earth_curvature=False))
    return graph(block, points, options=GraphOptions.model_validate(options), rng=np.random.default_rng(1))


def far_off(block: Block, solution: Solution) -> tuple[float, float]:
    """Largest error of the projection centres in m and of the rotations in rad."""
    true, oriented = block.true_images, solution.images.oriented
    assert true is not None
    centre = np.linalg.norm(solution.images.position_m - true.position_m, axis=1)[oriented]
    turned = solution.images.ground_from_image[oriented] @ true.ground_from_image[oriented].swapaxes(1, 2)
    return float(centre.max()), float(Rotation.from_matrix(turned).magnitude().max())


SMALL_UAV = {
    "preset": "uav", "earth": "flat", "refraction": "none", "flight": {"strips": 4, "images_per_strip": 6},
    "ties": {"random_per_image": 120.0},
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("preset", ["orbit", "oblique", "hover"])
def test_orbits_oblique_heads_and_hovering_are_oriented_without_strips_or_start(preset: str) -> None:
    less = {"oblique": {"flight": {"strips": 2, "images_per_strip": 4}, "ties": {"new_points": 1200}}}
    block = without_strips(simulated(preset=preset, **less.get(preset, {"ties": {"new_points": 300}})))
    found = initial_of(block)
    assert found.images.oriented.all()
    metres, radians = far_off(block, found)
    assert metres < 0.3
    assert radians < 0.005


@pytest.mark.parametrize("start", ["bases", "gnss", "random"])
def test_every_start_of_the_projection_centres_ends_at_the_same_block(start: str) -> None:
    block = without_strips(simulated(**SMALL_UAV))
    found = initial_of(block, positions=start, pairs_per_image=6)
    assert found.images.oriented.all()
    assert far_off(block, found)[0] < 0.2


def test_two_blocks_that_ten_points_join_become_one() -> None:
    block = without_strips(simulated(**SMALL_UAV))
    m = block.image_points
    second = np.char.startswith(block.images.id, "03") | np.char.startswith(block.images.id, "04")
    of_second = second[m.image]
    in_first, in_second = (np.bincount(m.point[rows], minlength=len(block.points)) for rows in (~of_second, of_second))
    both = np.flatnonzero((in_first >= 3) & (in_second >= 3))
    joining = both[:: max(len(both) // 10, 1)][:10]
    control = block.ground_points.point
    kept = ~of_second | (in_first[m.point] == 0) | np.isin(m.point, joining)
    kept &= of_second | ~np.isin(m.point, np.setdiff1d(control, joining)) | (in_second[m.point] == 0)
    block = replace(block, image_points=m.take(np.flatnonzero(kept)))
    shared = np.intersect1d(
        *(np.unique(block.image_points.point[second[block.image_points.image] == k]) for k in (0, 1))
    )
    assert len(shared) <= 10
    found = initial_of(block)
    assert found.images.oriented.all()
    assert far_off(block, found)[0] < 0.5


def test_three_percent_of_wrong_image_names_are_rejected_and_all_images_oriented() -> None:
    block = without_strips(simulated(**SMALL_UAV))
    m, rng = block.image_points, np.random.default_rng(3)
    rows = rng.choice(len(m), round(0.03 * len(m)), replace=False)
    image = m.image.copy()
    image[rows] = rng.integers(0, len(block.images), len(rows))
    key = image.astype(np.int64) * len(block.points) + m.point
    once = np.isin(key, np.flatnonzero(np.bincount(key) == 1))
    image = np.where(once, image, m.image).astype(np.int32)
    wrong = image != m.image
    order = np.lexsort((m.point, image))
    block = replace(block, image_points=replace(m, image=image).take(order))
    found = initial_of(block)
    assert found.images.oriented.all()
    assert far_off(block, found)[0] < 0.2
    rejected = np.zeros(len(m), dtype=bool)
    rejected[found.suspects.row[found.suspects.kind == "image_point"]] = True
    assert (rejected & wrong[order]).sum() > 0.97 * wrong.sum()
    assert (rejected & ~wrong[order]).sum() < 0.005 * len(m)


def test_positions_of_wrong_images_are_rejected_by_name() -> None:
    block = without_strips(simulated(**SMALL_UAV))
    exterior = block.exterior
    image = exterior.image.copy()
    image[[2, 20]] = image[[20, 2]]
    order = np.argsort(image)
    found = initial_of(replace(block, exterior=replace(exterior, image=image).take(order)), pairs_per_image=6)
    wrong = found.suspects.image[(found.suspects.kind == "position") & (found.suspects.verdict == "rejected")]
    assert sorted(wrong.tolist()) == sorted(block.images.id[[2, 20]].tolist())
    assert far_off(block, found)[0] < 0.2


def test_an_image_that_shares_no_points_is_named_and_the_rest_is_oriented() -> None:
    block = without_strips(simulated(**SMALL_UAV))
    m = block.image_points
    alone = m.image == 7
    block = replace(block, image_points=m.take(np.flatnonzero(~alone | (np.cumsum(alone) <= 5))))
    told = Told()
    points = systematic(block, calibrated(block), options=SystematicOptions(refraction=False, earth_curvature=False))
    found = graph(block, points, options=GraphOptions(pairs_per_image=6), context=told, rng=np.random.default_rng(1))
    assert found.images.oriented.sum() == len(block.images) - 1
    assert any("not oriented" in text and str(block.images.id[7]) in text for text in told.warnings)


class Told:
    """A context that keeps the warnings."""

    def __init__(self) -> None:
        self.warnings: list[str] = []

    def warn(self, message: str) -> None:
        self.warnings.append(message)

    def log(self, message: str) -> None:
        pass

    def progress(self, done: int, total: int, what: str = "") -> None:
        pass


def test_without_control_and_positions_distances_give_the_scale() -> None:
    block = without_strips(simulated(**SMALL_UAV))
    none = np.zeros(0, dtype=np.intp)
    true = block.true_points
    assert true is not None
    a, b = block.ground_points.point[:2]
    value = float(np.linalg.norm(true.xyz_m[a] - true.xyz_m[b]))
    ends = {"start": np.array([block.points.id[a]]), "end": np.array([block.points.id[b]])}
    distance = Geodetic(
        type=np.array(["distance"]), **ends, via=np.array([""]), start_kind=np.array(["point"]),
        end_kind=np.array(["point"]), value=np.array([value]), sigma=np.array([0.01]), set=np.array([""]),
        group=np.array([""]), start_height_m=np.array([np.nan]), end_height_m=np.array([np.nan]),
        active=np.array([True]), reduced=np.array(["no"]), file=np.array([-1]), line=np.array([-1]),
    )  # fmt: skip
    bare = replace(
        block, ground_points=block.ground_points.take(none), exterior=block.exterior.take(none), geodetic=distance
    )
    found = initial_of(bare, pairs_per_image=6)
    assert found.datum is not None
    xyz = found.points.xyz_m
    assert np.linalg.norm(xyz[a] - xyz[b]) == pytest.approx(value, rel=1e-9)


def test_models_that_are_given_are_used_and_no_others() -> None:
    block = simulated(**SMALL_UAV)
    points = systematic(block, calibrated(block), options=SystematicOptions(refraction=False, earth_curvature=False))
    models = essential(block, points)
    assert len(models.orientations) == 20  # the neighbours in four strips of six
    found = graph(block, points, models, rng=np.random.default_rng(1))
    assert found.images.oriented.all()  # the strips are components, and their common points join them
    assert far_off(block, found)[0] < 0.3
