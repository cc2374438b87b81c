"""A few blocks of the campaign of all kinds: as many kinds as there are, gross errors among them, found."""

from __future__ import annotations

import numpy as np
import pytest

from aatri.arrays import Float
from aatri.artifacts.block import Block
from aatri.stages.bundle_adjustment.bundle import BundleOptions, bundle
from aatri.stages.interior_orientation.calibrated import calibrated
from tests.campaigns.kinds import ALL, CASES, TOGETHER, judged, one_block
from tests.stages.geodetic_blocks import made


@pytest.mark.slow
def test_all_kinds_at_once_are_as_accurate_as_their_covariances_say() -> None:
    found = [one_block(TOGETHER, seed) for seed in range(1, 7)]
    assert found[0].kinds >= 13
    lines = judged(found, 0.01 / 4)
    assert all(ok for ok, _ in lines), lines


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_each_kind_alone_is_as_accurate_as_its_covariances_say(case: str) -> None:
    lines = judged([one_block(case, seed) for seed in range(1, 5)], 0.01 / (4 * len(CASES)))
    assert all(ok for ok, _ in lines), lines


@pytest.mark.slow
def test_large_gross_errors_of_every_kind_are_found() -> None:
    """Of geodetic observations and relative control of a surveyed block: those above twice the detectable error."""
    missed: list[tuple[int, str, int, float]] = []
    count = 0
    for seed in range(1, 4):
        gross = {"geodetic": 6, "relative_control": 3, "size_sigmas": (40.0, 60.0)}
        surveyed = ALL | {"gnss": {}, "rig": {}}
        detectable = _detectable(made(seed, 1000.0, **surveyed))
        block = made(seed, 1000.0, **surveyed, gross_errors=gross)
        # Six of some hundred geodetic observations, but up to three of the twelve of one kind.
        options = BundleOptions.model_validate({"blunders": {"method": "robust_snooping", "max_share": 0.3}})
        solution = bundle(block, calibrated(block), options=options)
        assert block.gross_errors is not None
        assert 0.8 < solution.sigma0 < 1.2
        found = set(zip(solution.suspects.kind.tolist(), solution.suspects.row.tolist()))
        for kind, row, size in zip(block.gross_errors.kind.tolist(), block.gross_errors.row, block.gross_errors.size):
            in_detectable = float(np.nanmax(np.abs(size) / detectable.get((kind, int(row)), np.full(3, np.inf))))
            if in_detectable > 2.0:
                count += 1
                if (kind, int(row)) not in found:
                    missed.append((seed, kind, int(row), in_detectable))
    assert count >= 12
    assert len(missed) <= 0.02 * count, (missed, count)


def _detectable(block: Block) -> dict[tuple[str, int], Float]:
    """Detectable error of every observation of a block without gross errors; infinite where nothing controls it."""
    solution = bundle(block, calibrated(block), options=BundleOptions(blunders="none", reliability=True))
    rows, tests = solution.residuals, solution.tests
    assert tests is not None
    size = np.where(np.isfinite(tests.detectable), tests.detectable, np.inf)
    return dict(zip(zip(rows.kind.tolist(), rows.row.tolist()), size))
