"""The campaign of groups, one block of each kind."""

from __future__ import annotations

import pytest

from tests.campaigns.groups import outcomes


@pytest.mark.slow
def test_every_group_is_named_and_a_clean_block_is_not_blamed() -> None:
    bad = [(block, way, found.told) for block, way, found in outcomes(1, []) if found.bad]
    assert not bad
