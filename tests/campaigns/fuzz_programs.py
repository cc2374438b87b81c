"""Files of other programs in the fuzz campaign: the small good samples of the twelve damages, one of every format."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

from aatri.artifacts.block import Block
from aatri.errors import AatriError
from aatri.formats.parts.assembled import assembled
from aatri.formats.parts.block_parts import BlockParts
from aatri.formats.registry.sources import read_source
from aatri.progress import SILENT
from tests.campaigns.fuzz_seeds import Reader
from tests.formats.damage.good_sample import GoodSample
from tests.formats.damage.samples_of_lists import OF_LISTS
from tests.formats.damage.samples_of_programs import OF_PROGRAMS


def reader_of(name: str, sample: GoodSample) -> Reader:
    """The reader of a format, over all files of its sample; what is a block by itself is made one."""

    def parts_of(folder: Path) -> BlockParts:
        path = folder / (sample.file if sample.path is None else sample.path)
        return read_source(path, sample.reading.model_copy(update={"format": name}), SILENT)

    def block_of(folder: Path) -> Block:
        return assembled([parts_of(folder)])

    @cache
    def is_block() -> bool:
        with TemporaryDirectory() as folder:
            sample.write(Path(folder))
            try:
                block_of(Path(folder))
            except AatriError:
                return False
        return True

    def read(folder: Path) -> Block | BlockParts:
        return block_of(folder) if is_block() else parts_of(folder)

    return Reader(sample.write, read, tuple(sample.files))


OF_OTHER_PROGRAMS = {name: reader_of(name, sample) for name, sample in (OF_PROGRAMS | OF_LISTS).items()}
"""Readers of the files of other programs, by the names of their formats."""
