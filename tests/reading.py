"""Blocks read and screened, as the stages of the role `block` do it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from aatri.artifacts.block import Block
from aatri.checks.as_read.screening import screened
from aatri.checks.limits import MAX_REJECT_SHARE
from aatri.formats.bal import problem as bal
from aatri.formats.colmap import reader as colmap
from aatri.formats.dbat import reader as dbat
from aatri.formats.gama import reader as gama
from aatri.formats.pairs import reader as pairs
from aatri.formats.tables import reader as tables
from aatri.formats.wucaps import reader as wucaps
from aatri.progress import SILENT, Reporter


def _then_screened(read: Callable[..., Block], **screening: Any) -> Callable[..., Block]:
    def reading(
        *given: Any, reporter: Reporter = SILENT, max_reject_share: float = MAX_REJECT_SHARE, **options: Any
    ) -> Block:
        return screened(read(*given, reporter=reporter, **options), reporter, max_reject_share, **screening)

    return reading


read_bal = _then_screened(bal.read_bal, copies=True)
read_colmap = _then_screened(colmap.read_colmap)
read_dbat = _then_screened(dbat.read_dbat)
read_gama = _then_screened(gama.read_gama)
read_pairs = _then_screened(pairs.read_pairs)
read_wucaps = _then_screened(wucaps.read_wucaps)


def read_block(folder: Path, reporter: Reporter = SILENT, max_reject_share: float = MAX_REJECT_SHARE) -> Block:
    """A block folder."""
    return screened(tables.read_block(folder, reporter), reporter, max_reject_share)
