"""Every registered reader answers twelve damaged files with what is wrong, where, and what to do; never a part."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest

from aatri.errors import AatriError
from aatri.formats.parts.assembled import assembled
from aatri.formats.registry.catalogue import FORMATS
from aatri.formats.registry.recognised import recognised
from aatri.formats.registry.sources import read_source
from aatri.progress import SILENT
from tests.formats.damage.good_sample import DAMAGES, WITHOUT_LINE
from tests.formats.damage.samples_of_lists import OF_LISTS
from tests.formats.damage.samples_of_own_stages import OF_OWN_STAGES
from tests.formats.damage.samples_of_programs import OF_PROGRAMS, OF_VARIANTS

SAMPLES = OF_PROGRAMS | OF_LISTS | OF_OWN_STAGES | OF_VARIANTS
READ = [f.name for f in FORMATS if f.read and f.name != "photos"]
"""Photographs are no text and have damages of their own: tests/formats/navigation/test_photo_folder.py."""


def format_of(name: str) -> str:
    """The format of a sample: its name, or the first part of it."""
    return name.partition("/")[0]


def read(path: Path, name: str, *, whole: bool) -> None:
    """Read a source; where it is a block by itself, make that of it."""
    parts = read_source(path, SAMPLES[name].reading.model_copy(update={"format": format_of(name)}), SILENT)
    if whole:
        assembled([parts])


@cache
def is_whole(name: str) -> bool:
    """Whether the good sample is read, and is a block by itself."""
    with TemporaryDirectory() as folder:
        path = SAMPLES[name].write(Path(folder))
        read(path, name, whole=False)
        try:
            read(path, name, whole=True)
        except AatriError:
            return False
        return True


def test_every_reader_has_a_sample() -> None:
    assert {format_of(name) for name in SAMPLES} == {*READ}


@pytest.mark.parametrize("name", SAMPLES)
def test_the_good_sample_is_read_and_recognised(tmp_path: Path, name: str) -> None:
    is_whole(name)
    path = SAMPLES[name].write(tmp_path)
    assert format_of(name) in [r.format.name for r in recognised(path)]


@pytest.mark.parametrize("damage", DAMAGES)
@pytest.mark.parametrize("name", SAMPLES)
def test_a_damaged_file_is_refused_with_its_place_and_a_remedy(tmp_path: Path, name: str, damage: str) -> None:
    sample = SAMPLES[name]
    reason = {"wrong unit": sample.unit, "duplicated ids": sample.twice}.get(damage)
    if isinstance(reason, str):
        pytest.skip(reason)
    path = sample.write(tmp_path, lambda _: DAMAGES[damage](sample))
    file = tmp_path / sample.file
    if damage == "path outside" and not sample.outside:
        file.unlink()
        file.symlink_to("/nowhere/at/all")
    with pytest.raises(AatriError) as refused:
        read(path, name, whole=is_whole(name))
    text = str(refused.value)
    assert "fix: " in text
    names = "|".join(re.escape(Path(name).name) for name in sample.files)
    assert re.search(names, text) or damage == "path outside"
    assert damage in WITHOUT_LINE or re.search(rf"({names})(/doc.xml)?:\d+", text), text
