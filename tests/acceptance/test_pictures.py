"""The pictures of the documentation are what their script makes, and every method page has one.

python docs/pictures/make.py     makes them anew
"""

from __future__ import annotations

import importlib.util
import io
import re
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

ROOT = Path(__file__).parents[2]
PICTURES = ROOT / "docs" / "pictures"
NUMBER = re.compile(r"-?\d+(?:\.\d+)?")


def _script(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.syspath_prepend(str(PICTURES))
    spec = importlib.util.spec_from_file_location("docs_pictures", PICTURES / "make.py")
    assert spec is not None
    assert spec.loader is not None
    made = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(made)
    return made


@pytest.mark.parametrize("page", sorted((ROOT / "docs" / "methods").glob("*.md")), ids=lambda page: page.stem)
def test_a_method_page_begins_with_what_it_is_for_and_a_picture(page: Path) -> None:
    title, purpose, picture = page.read_text(encoding="utf-8").split("\n\n")[:3]
    assert title.startswith("# ")
    assert re.match(r"\w", purpose), "a sentence comes first: what the method is for"
    assert re.fullmatch(rf"!\[.+\]\(\.\./pictures/{page.stem}\.svg\)", picture.strip())


@pytest.mark.slow
def test_pictures_are_what_the_script_makes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made = dict(_script(monkeypatch).files(set(), tmp_path))
    there = {path.name for path in PICTURES.iterdir() if path.suffix in (".svg", ".png")}
    if any(name.endswith(".png") for name in made):  # a machine with a browser
        assert set(made) == there
    for name, content in made.items():
        shown = (PICTURES / name).read_bytes()
        assert (_alike if name.endswith(".svg") else _look_alike)(content, shown), f"{name} is not what make.py makes"


def _alike(made: bytes, shown: bytes) -> bool:
    """The same but for the last digits, which depend on the processor."""
    texts = [text.decode() for text in (made, shown)]
    if NUMBER.sub("", texts[0]) != NUMBER.sub("", texts[1]):
        return False
    a, b = (np.array(NUMBER.findall(text), float) for text in texts)
    return bool(np.allclose(a, b, rtol=1e-3, atol=0.2))


def _look_alike(made: bytes, shown: bytes) -> bool:
    """Screenshots of one page: fonts differ between machines, and times between runs."""
    image = pytest.importorskip("PIL.Image")
    small = [image.open(io.BytesIO(png)).convert("L").resize((50, 40)) for png in (made, shown)]
    a, b = (np.asarray(one, float) for one in small)
    return bool(np.abs(a - b).mean() < 8.0)  # of 255; a page of other content differs by 20 and more
