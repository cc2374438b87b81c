"""What was read, in one line of the log."""

from __future__ import annotations

from aatri.artifacts.block import Block
from aatri.progress import Reporter


def log_counts(block: Block, reporter: Reporter) -> None:
    """Log the counts of a block."""
    counts = ", ".join(f"{value} {name.replace('_', ' ')}" for name, value in block.metrics().items() if value)
    reporter.log(f"block {block.name}: {counts}")
