"""A datum of any kind that is determined can begin; one that is open ends by naming what is open."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from aatri.errors import ConvergenceError, GeometryError
from tests.small_blocks import Small, adjusted_by, flown, measure, off_m, two_apart


def bare(tilt_deg: float = 0.0) -> Small:
    """Two strips of four images, of whose datum nothing is known."""
    made = flown(2, 4, tilt_deg=tilt_deg)
    made.control, made.observed = {}, {}
    return made


def distance(small: Small, a: str, b: str) -> None:
    value = float(np.linalg.norm(small.xyz_m[a] - small.xyz_m[b]))
    small.geodetic.append(f"distance,{a},{b},{value!r},0.01,,,,")


def azimuth(small: Small, a: str, b: str) -> None:
    """From grid north, clockwise."""
    d = small.xyz_m[b] - small.xyz_m[a]
    small.geodetic.append(f"azimuth,{a},{b},{float(np.degrees(np.arctan2(d[0], d[1])) % 360)!r},0.002,,,,")


def heights(small: Small, a: str, *others: str) -> None:
    """Levelled height differences."""
    small.geodetic += [
        f"height_difference,{a},{b},{float(small.xyz_m[b][2] - small.xyz_m[a][2])!r},0.01,,,," for b in others
    ]


def levelled(tilt_deg: float = 0.0) -> Small:
    """One point, a distance, an azimuth, and a level."""
    made = bare(tilt_deg)
    made.control = {"C1": "XYZ"}
    distance(made, "C1", "C4")
    azimuth(made, "C1", "C4")
    heights(made, "C1", "C2", "C3", "C4")
    return made


def two_points_and_a_level() -> Small:
    made = bare()
    made.control = {"C1": "XYZ", "C2": "XYZ"}
    heights(made, "C1", "C3", "C4")
    return made


def coordinates_one_by_one() -> Small:
    made = bare()
    made.control = {"C1": "X", "C2": "Y", "C3": "XYZ", "C4": "Z", "p30": "Z"}
    distance(made, "C1", "C4")
    return made


def houses() -> Small:
    """Edges of houses, plumb; a distance along the ground with its azimuth, and one point."""
    made = bare()
    made.xyz_m |= {"top1": made.xyz_m["p20"] + [0, 0, 40.0], "top2": made.xyz_m["p50"] + [0, 0, 35.0]}
    measure(made, np.random.default_rng(5))
    made.relative = [
        {"type": "plumb_line", "points": [foot, top], "sigma": 0.005}
        for foot, top in (("p20", "top1"), ("p50", "top2"))
    ]
    made.control = {"C1": "XYZ"}
    distance(made, "C1", "C4")
    azimuth(made, "C1", "C4")
    return made


def some_positions(axes: str, *control: tuple[str, str]) -> Small:
    made = bare()
    made.observed, made.control = {"101": axes, "104": axes}, dict(control)
    return made


OF_ALL_KINDS = [
    pytest.param(levelled, 0.3, id="levelled"),
    pytest.param(lambda: levelled(40.0), 0.3, id="levelled and tilted"),
    pytest.param(two_points_and_a_level, 0.3, id="two points and a level"),
    pytest.param(coordinates_one_by_one, 0.4, id="coordinates one by one"),
    pytest.param(houses, 1.0, id="houses"),
]
OF_POSITIONS = [
    pytest.param(lambda: some_positions("XYZ", ("C2", "Z"), ("C4", "Z")), 0.3, id="positions"),
    pytest.param(lambda: some_positions("XY", ("C1", "Z"), ("C2", "Z"), ("C4", "Z")), 0.3, id="positions in plan"),
]


def begins(chain: str, small: Small, folder: Path, within_m: float) -> None:
    done = adjusted_by(chain, small.write(folder / "block"))
    assert done.bundle.images.oriented.all()
    assert off_m(small, done.initial) < 2 * within_m
    assert off_m(small, done.bundle) < within_m
    assert done.bundle.sigma0 < 1.3


@pytest.mark.slow
@pytest.mark.parametrize(("made", "within_m"), [*OF_ALL_KINDS, *OF_POSITIONS])
def test_a_determined_datum_begins(tmp_path: Path, made: Callable[[], Small], within_m: float) -> None:
    begins("graph", made(), tmp_path, within_m)


@pytest.mark.slow
@pytest.mark.parametrize(("made", "within_m"), OF_ALL_KINDS)
def test_observations_of_all_kinds_begin_the_chain(tmp_path: Path, made: Callable[[], Small], within_m: float) -> None:
    begins("chain", made(), tmp_path, within_m)


@pytest.mark.slow
@pytest.mark.parametrize(("made", "within_m"), OF_POSITIONS)
def test_positions_and_heights_begin_the_chain(tmp_path: Path, made: Callable[[], Small], within_m: float) -> None:
    begins("chain", made(), tmp_path, within_m)


def without(small: Small, *kinds: str) -> Small:
    small.geodetic = [row for row in small.geodetic if not row.startswith(kinds)]
    return small


@pytest.mark.slow(after=1)
@pytest.mark.parametrize(
    ("made", "open_"),
    [
        (lambda: without(levelled(), "height"), "rotation about"),
        (lambda: without(levelled(), "azimuth"), "rotation about Z"),
        (lambda: without(levelled(), "distance", "height_difference,C1,C4"), "scale"),
    ],
)
def test_an_open_datum_is_named(tmp_path: Path, made: Callable[[], Small], open_: str) -> None:
    folder: Any = made().write(tmp_path / "block")
    with pytest.raises(GeometryError, match=f"not determined: .*{open_}"):
        adjusted_by("graph", folder)


def with_first(small: Small, kind: str, change: Callable[[float], float]) -> Small:
    """The same block with another value of the first observation of a kind."""
    at = next(k for k, row in enumerate(small.geodetic) if row.startswith(kind))
    cells = small.geodetic[at].split(",")
    small.geodetic[at] = ",".join([*cells[:3], repr(change(float(cells[3]))), *cells[4:]])
    return small


@pytest.mark.slow
def test_a_distance_in_mm_is_left_out_where_the_datum_hangs_on_distances(tmp_path: Path) -> None:
    made = levelled()
    distance(made, "C2", "C3")
    distance(made, "C1", "C3")
    begins("graph", with_first(made, "distance", lambda metres: 1000 * metres), tmp_path, 0.3)


@pytest.mark.slow
def test_two_azimuths_of_which_one_is_turned_about_are_both_named_and_no_control_is_called_mirrored(
    tmp_path: Path,
) -> None:
    """By either alone the block lies well, by the wrong one turned by 180 degrees about its point."""
    made = levelled()
    azimuth(made, "C2", "C3")
    folder = with_first(made, "azimuth", lambda degrees: (degrees + 180) % 360).write(tmp_path / "block")
    with pytest.raises(GeometryError, match="is wrong: azimuth C1-C4, azimuth C2-C3\n"):
        adjusted_by("graph", folder)


def test_positions_that_place_nothing_leave_the_images_to_be_oriented_alone(tmp_path: Path) -> None:
    """Two positions leave the turn about their line open; photographs of a telephone along a street do, too."""
    made = flown(1, 4)
    made.control, made.observed = {}, dict.fromkeys(list(made.position_m)[:2], "XYZ")
    with pytest.raises(GeometryError, match=r"^component 1 \(4 images\).*") as caught:
        adjusted_by("graph", made.write(tmp_path / "block"))
    assert "`use_positions: false`, in the bundle `datum: free`" in caught.value.remedy


@pytest.mark.slow
def test_points_in_two_images_alone_leave_components_and_the_message_says_how_many(tmp_path: Path) -> None:
    """Nothing carries the scale from one pair to the next: two control points of the outer pairs do, one does not."""
    made = flown(1, 4, points=40)
    made.observed = {}
    images = sorted(made.position_m)
    pairs = list(pairwise(images))
    for number, point in enumerate(sorted(made.xyz_m)):
        there = {image for image, seen in made.rays if seen == point}
        both = [pair for pair in pairs if set(pair) <= there]
        keep = both[number % len(both)] if both else ()
        for image in there - set(keep):
            del made.rays[image, point]
    done = adjusted_by("graph", made.write(tmp_path / "a")).bundle
    assert off_m(made, done) < 4 * np.sqrt(np.einsum("nii->n", done.images.covariance[:, :3, :3]).max())
    del made.control["C2"], made.control["C4"]
    with pytest.raises(GeometryError, match="the images stay in 3 components") as refused:
        adjusted_by("graph", made.write(tmp_path / "b"))
    assert refused.value.remedy.startswith(
        "measure points in three images or more: 5 common points join two components; "
    )


@pytest.mark.slow
def test_a_block_whose_largest_part_is_mirrored_is_refused_though_attitudes_place_another(tmp_path: Path) -> None:
    small = two_apart(strips=2, per_strip=3)
    small.rays = {key: xy * [1.0, -1.0] for key, xy in small.rays.items()}
    small.without_rays("B103")
    small.attitudes = [i for i in small.strip if i.startswith("B")]
    with pytest.raises(GeometryError, match="mirrored"):
        adjusted_by("graph", small.write(tmp_path / "block"))


@pytest.mark.slow
@pytest.mark.parametrize("chain", ["chain", "graph"])
def test_a_ray_of_one_image_to_a_third_control_point_holds_the_turn_about_two(tmp_path: Path, chain: str) -> None:
    small = flown(2, 4, relief_m=0.0)
    small.observed, small.control = {}, {p: small.control[p] for p in ("C1", "C2", "C3")}
    first, *others = [i for i, p in small.rays if p == "C3"]
    for image in others:
        del small.rays[image, "C3"]
    done = adjusted_by(chain, small.write(tmp_path / "block")).bundle
    assert done.images.oriented.all()
    assert off_m(small, done) < 1.0
    del small.rays[first, "C3"]
    with pytest.raises(GeometryError, match="rotation about the line"):
        adjusted_by(chain, small.write(tmp_path / "open"))


@pytest.mark.slow
@pytest.mark.parametrize("chain", ["chain", "graph"])
def test_positions_one_row_off_are_told_so(tmp_path: Path, chain: str) -> None:
    small = flown(3, 4)
    small.control = {}
    ids = list(small.position_m)
    small.position_m = dict(zip(ids, np.roll(list(small.position_m.values()), 1, axis=0)))
    with pytest.raises((GeometryError, ConvergenceError), match="one row off") as refused:
        adjusted_by(chain, small.write(tmp_path / "block"))
    assert "that of image 102 fits image 101" in str(refused.value)


@pytest.mark.slow
def test_a_straight_strip_is_oriented_by_antennas_and_attitudes_whichever_way_it_flies(tmp_path: Path) -> None:
    """Level and heading east it has no scale: to say what is open it must lie as its positions say."""
    small = flown(1, 5)
    turn, arm_m = Rotation.from_euler("Z", 215, degrees=True).as_matrix(), np.array([0.2, -0.3, 0.1])
    small.rotation = {i: turn @ R for i, R in small.rotation.items()}
    small.position_m = {i: turn @ X + small.rotation[i] @ arm_m for i, X in small.position_m.items()}
    small.xyz_m = {p: turn @ X for p, X in small.xyz_m.items()}
    small.control, small.attitudes = {}, list(small.strip)
    small.camera = {"lever_arm": arm_m.tolist()}
    folder = small.write(tmp_path / "block")
    head, *rows = (folder / "exterior.csv").read_text().split()
    (folder / "exterior.csv").write_text("\n".join([f"{head},refers_to", *(f"{row},antenna" for row in rows), ""]))
    done = adjusted_by("chain", folder).bundle
    assert done.images.oriented.all()
    assert off_m(small, done) < 0.2 + np.linalg.norm(arm_m)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [2, 30])
def test_few_points_hold_an_image_so_loosely_that_its_position_and_control_are_no_gross_errors(
    tmp_path: Path, seed: int
) -> None:
    """A rigid component would have to reject them; its rays let it bend to all that is observed."""
    small = flown(2, 5, seed=seed, points=5, relief_m=100.0)
    small.attitudes = list(small.strip)
    s = adjusted_by("graph", small.write(tmp_path / "block")).initial.suspects
    assert not (s.staying_out & (s.kind != "image_point")).any()


def test_a_lever_arm_of_given_weight_goes_with_positions_that_contradict_all_else(tmp_path: Path) -> None:
    small = flown(strips=2)
    small.camera = {"lever_arm": [0.0] * 3, "sigmas": {"lever_arm": [0.05] * 3}}
    small.position_m = {i: x + np.array([0.0, 0.0, 3.0]) for i, x in small.position_m.items()}
    exterior = small.write(tmp_path / "block") / "exterior.csv"
    first, *rows = exterior.read_text().splitlines()
    exterior.write_text("\n".join([f"{first},refers_to", *(f"{row},antenna" for row in rows), ""]))
    assert any("contradict all else" in text for text in adjusted_by("graph", exterior.parent).warnings)
