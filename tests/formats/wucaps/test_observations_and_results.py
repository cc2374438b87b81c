"""WuCAPS: the file of non-photogrammetric observations there and back, its faults by line, and results read again."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from aatri.artifacts.block import OBSERVED_VALUE, Block, Exterior, Geodetic
from aatri.errors import AatriError
from aatri.formats.wucaps.reader import read_wucaps
from aatri.formats.wucaps.writer import write_wucaps
from tests.stages.chain import Chain, run_chain, simulated


@pytest.fixture(scope="module")
def chain() -> Chain:
    return run_chain(
        simulated(
            3,
            preset="rc30",
            earth="flat",
            flight={"strips": 2, "images_per_strip": 4},
            known={"full": 8},
            ties={"new_points": 60},
        )
    )


def observed(block: Block) -> Block:
    """The block with positions and attitudes of its first images, and one geodetic observation of each type."""
    rng, ids = np.random.default_rng(1), block.points.id[block.ground_points.point]
    types = ["angle", "azimuth", "distance", "height_difference", "horizontal_distance", "zenith"]
    n = len(types)
    geodetic = Geodetic.of(
        type=np.array(types),
        start=ids[:n],
        end=ids[1 : n + 1],
        via=np.array([str(ids[-1])] + [""] * (n - 1)),
        value=rng.uniform(0.2, 3.0, n),
        sigma=rng.uniform(1e-4, 1e-2, n),
    )
    exterior = Exterior.of(
        image=np.arange(3),
        position_m=rng.normal(size=(3, 3)) * 100,
        position_covariance_m2=np.stack([np.diag(s) for s in rng.uniform(0.01, 0.1, (3, 3)) ** 2]),
        angles_rad=rng.normal(size=(3, 3)),
        angle_sigma_rad=rng.uniform(1e-4, 1e-3, (3, 3)),
        position_use=OBSERVED_VALUE,
        angle_use=OBSERVED_VALUE,
    )
    return replace(block, exterior=exterior, geodetic=geodetic, rotation="phi-omega-kappa")


def test_observations_go_there_and_back(chain: Chain, tmp_path: Path) -> None:
    block = observed(chain.block)
    write_wucaps(block, tmp_path, chain.refined)
    again = read_wucaps(tmp_path)
    for name in ("position_m", "position_covariance_m2", "angles_rad", "angle_sigma_rad"):
        np.testing.assert_allclose(getattr(again.exterior, name), getattr(block.exterior, name), rtol=1e-14)
    assert again.exterior.position_use.tolist() == [OBSERVED_VALUE] * 3
    for name in ("type", "start", "end", "via"):
        assert getattr(again.geodetic, name).tolist() == getattr(block.geodetic, name).tolist()
    np.testing.assert_allclose(again.geodetic.value, block.geodetic.value, rtol=1e-14)
    np.testing.assert_allclose(again.geodetic.sigma, block.geodetic.sigma, rtol=1e-14)


def test_what_has_no_place_is_counted_and_told(chain: Chain, tmp_path: Path) -> None:
    block = observed(chain.block)
    g, e = block.geodetic, block.exterior
    block = replace(
        block,
        geodetic=replace(g, group=np.array(["g", *[""] * (len(g) - 1)])),
        exterior=replace(e, drift_group=np.array(["1", "", ""])),
        rotation="omega-phi-kappa",
    )
    told = [str(note) for note in write_wucaps(block, tmp_path, chain.refined)]
    assert any(text.startswith("1 positions of antennas, of drift groups") for text in told)
    assert any(text.startswith("3 attitudes in part, or of another system") for text in told)
    assert any(text.startswith("1 geodetic observations") for text in told)
    assert len(read_wucaps(tmp_path).geodetic) == len(g) - 1


@pytest.mark.parametrize(
    ("line", "told"),
    [
        ("distance A B 10", "PRENPI.DAT:1: 4 words"),
        ("bearing A B 10 1", "'bearing' is no kind of observation"),
        ("distance A B ten 1", "PRENPI.DAT:1: 'ten': not a number"),
        ("distance A B 10 0", "standard deviation that is not above 0"),
        ("position nobody 1 2 3 1 1 1", "nobody"),
    ],
)
def test_faults_are_named_by_line(chain: Chain, tmp_path: Path, line: str, told: str) -> None:
    write_wucaps(chain.block, tmp_path, chain.refined)
    (tmp_path / "PRENPI.DAT").write_text(f"{line}\n-99\n")
    with pytest.raises(AatriError) as error:
        read_wucaps(tmp_path)
    assert told in str(error.value)


def test_results_say_what_the_solution_says(chain: Chain, tmp_path: Path) -> None:
    s = chain.bundle
    write_wucaps(chain.block, tmp_path, chain.refined, s)
    files = {
        name: [line.split() for line in (tmp_path / f"{name}.DAT").read_text().split("\n") if line]
        for name in ("RESORI", "RESPNT", "RESVPT", "RESVGC")
    }
    assert all(lines[-1] == ["-99"] for lines in files.values())
    image = s.images.id.tolist().index(files["RESORI"][0][0])
    north, east, up, phi, omega, kappa, s_north, *_ = map(float, files["RESORI"][0][1:])
    assert (east, north, up) == tuple(s.images.position_m[image])
    R = Rotation.from_euler("YXZ", [-phi, omega, kappa], degrees=True).as_matrix()
    np.testing.assert_allclose(R, s.images.ground_from_image[image], atol=1e-12)
    assert s_north == pytest.approx(np.sqrt(s.images.covariance[image, 1, 1]))
    assert len(files["RESPNT"]) == np.isfinite(s.points.xyz_m).all(axis=1).sum() + 1
    rows = (s.residuals.kind == "image_point") & s.residuals.active
    heads = [words for words in files["RESVPT"] if len(words) == 2]
    assert sum(int(count) for _, count in heads) == rows.sum()
    of_first = s.residuals.residual[rows][0, :2] * 1e3
    assert [float(v) for v in files["RESVPT"][1][1:]] == of_first.tolist()
    assert len(files["RESVGC"]) == ((s.residuals.kind == "control") & s.residuals.active).sum() + 1
