"""Where an imported row comes from, for messages."""

from __future__ import annotations

from aatri.artifacts.block import Block


def place(block: Block, file: int, line: int) -> str:
    """`file:line` of an imported row, from its columns `file` and `line`; empty if it was not imported."""
    return f"{block.files.path[file]}:{line}" if file >= 0 else ""
