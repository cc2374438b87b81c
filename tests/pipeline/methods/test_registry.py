"""Where stages come from, and what is said when one breaks its contract."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

import aatri.stages
from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.errors import PluginError
from aatri.pipeline.methods.discovery import file_of_module
from aatri.pipeline.methods.registry import Registry, find_stages, first_line

BUILT_IN = Path(aatri.stages.__path__[0])

MINE = '''"""Mine."""
from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.models import Models
from aatri.plugin import SILENT, Context, Options, stage


class MineOptions(Options):
    """Options."""


@stage(version=1)
def mine(block: Block, *, options: MineOptions = MineOptions(), context: Context = SILENT) -> ImagePoints:
    """Do it."""
    raise NotImplementedError
'''
GRAVITY = """from aatri.artifacts.block import Block
from aatri.plugin import Role

ROLE = Role(ports={"block": Block}, kind=Block)
"""
BOUGUER = '''"""Bouguer."""
from aatri.artifacts.block import Block
from aatri.plugin import stage

from ._constants import G


@stage(version=3)
def bouguer(block: Block) -> Block:
    """Do it."""
    return block
'''


def write(folder: Path, files: dict[str, str]) -> Path:
    for name, text in files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    return folder


def install(folder: Path, entry_points: str, files: dict[str, str], name: str = "others-stages") -> None:
    """What `pip install` leaves in site-packages."""
    write(folder, files)
    write(
        folder / f"{name.replace('-', '_')}-2.1.dist-info",
        {
            "METADATA": f"Metadata-Version: 2.1\nName: {name}\nVersion: 2.1\n",
            "entry_points.txt": f"[aatri.stages]\n{entry_points}",
        },
    )


@pytest.fixture
def site(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A folder of installed packages; what is imported from it is forgotten afterwards."""
    folder = tmp_path / "site"
    folder.mkdir()
    before = set(sys.modules)
    monkeypatch.syspath_prepend(str(folder))
    yield folder
    for name in set(sys.modules) - before:
        if str(getattr(sys.modules[name], "__file__", "")).startswith(str(folder)):
            del sys.modules[name]


def breach(registry: Registry, name: str) -> PluginError:
    with pytest.raises(PluginError) as caught:
        registry.card(name)
    assert caught.value.exit_code == 9
    return caught.value


def test_a_stage_of_the_project_is_found_only_where_asked_for(tmp_path: Path) -> None:
    local = write(tmp_path / "stages", {"interior_orientation/mine.py": MINE})
    assert "interior_orientation/mine" not in find_stages().variants
    registry = find_stages(local)
    card = registry.card("interior_orientation/mine")
    assert (card.kind, card.version, [p.name for p in card.ports]) == (ImagePoints, 1, ["block"])
    assert card.function.__module__.startswith("aatri_project_")
    assert registry.origins["interior_orientation/mine"].source == "project"
    assert registry.origins["interior_orientation/mine"].file == local / "interior_orientation" / "mine.py"
    assert registry.origins["interior_orientation/affine"].source == "built-in"
    assert first_line(registry, "interior_orientation/mine") == "Mine."
    assert "aatri.stages.interior_orientation.mine" not in sys.modules


def test_a_project_may_bring_a_role_of_its_own_with_helpers(tmp_path: Path) -> None:
    files = {"gravity/__init__.py": GRAVITY, "gravity/bouguer.py": BOUGUER, "gravity/_constants.py": "G = 6.674e-11\n"}
    registry = find_stages(write(tmp_path / "stages", files))
    assert dict(registry.role("gravity").ports) == {"block": Block}
    assert registry.card("gravity/bouguer").version == 3
    assert registry.variants_of("gravity") == ["gravity/bouguer"]


def test_two_projects_do_not_see_each_others_stages(tmp_path: Path) -> None:
    other = MINE.replace("version=1", "version=2")
    first = find_stages(write(tmp_path / "a" / "stages", {"interior_orientation/mine.py": MINE}))
    second = find_stages(write(tmp_path / "b" / "stages", {"interior_orientation/mine.py": other}))
    names = {r.origins["interior_orientation/mine"].module for r in (first, second)}
    assert names == {"aatri_project.interior_orientation.mine"}  # so that a project may be moved
    assert first.card("interior_orientation/mine").version == 1
    assert second.card("interior_orientation/mine").version == 2


def test_the_built_in_folder_met_again_counts_once(tmp_path: Path) -> None:
    assert find_stages(BUILT_IN).origins == find_stages().origins
    (tmp_path / "stages").symlink_to(BUILT_IN)
    registry = find_stages(tmp_path / "stages")
    assert registry.card("block/simulate").function.__module__ == "aatri.stages.block.simulate"


def test_a_name_met_twice_names_both_files(tmp_path: Path) -> None:
    local = write(tmp_path / "stages", {"interior_orientation/affine.py": MINE.replace("mine", "affine")})
    with pytest.raises(PluginError) as caught:
        find_stages(local)
    assert caught.value.exit_code == 9
    assert str(local / "interior_orientation" / "affine.py") in caught.value.what
    assert str(BUILT_IN / "interior_orientation" / "affine.py") in caught.value.what
    local = write(tmp_path / "again", {"block/__init__.py": GRAVITY})
    with pytest.raises(PluginError, match="role block is there twice"):
        find_stages(local)


@pytest.mark.parametrize("name", ["interior_orientation/My.py", "interior_orientation/a-b.py", "Interior/mine.py"])
def test_a_file_no_variant_can_be_named_after_is_an_error(tmp_path: Path, name: str) -> None:
    local = write(tmp_path / "stages", {name: MINE})
    with pytest.raises(PluginError, match="can have this name") as caught:
        find_stages(local)
    assert "small letters" in caught.value.remedy
    assert caught.value.where.startswith(str(local))


def test_what_is_no_role_is_left_alone(tmp_path: Path) -> None:
    files = {"_tools/mine.py": "", ".git/x.py": "", "Data-1/points.csv": "", "README.md": "", "helper.py": ""}
    assert find_stages(write(tmp_path / "stages", files)).origins == find_stages().origins
    with pytest.raises(PluginError, match="no such folder"):
        find_stages(tmp_path / "nowhere")


BREACHES = {
    "port": ("block: Block, *", "blok: Block, *", "asks for port 'blok' - did you mean 'block'?", ":12"),
    "port kind": ("block: Block, *", "block: Models, *", "takes Models at port block; its role gives Block", ":12"),
    "kind": ("-> ImagePoints", "-> Models", "returns Models; its role returns ImagePoints", ":12"),
    "no kind": (" -> ImagePoints", "", "not a kind of artifact", ":12"),
    "no stage": ("@stage(version=1)\n", "", "not a stage", ":12"),
    "version": ("version=1", "version='1'", "version of interior_orientation/mine is '1'", ":12"),
    "options": ("MineOptions(Options)", "MineOptions", "options are not a model derived from", ":12"),
    "untyped options": ("options: MineOptions", "options", "options of interior_orientation/mine have no type", ":12"),
    "name": ("def mine", "def other", "has no function mine; it has other", "mine.py"),
    "import": ("import Models", "import Modles", "cannot be imported: ImportError", ":4"),
    "syntax": ("class MineOptions(Options):", "class MineOptions(Options)", "cannot be imported: SyntaxError", ":8"),
    "unknown type": ("block: Block, *", "block: 'Blok', *", "annotations cannot be resolved: NameError", ":12"),
}


@pytest.mark.parametrize("case", BREACHES)
def test_a_breach_of_the_contract_names_file_and_remedy(tmp_path: Path, case: str) -> None:
    old, new, said, place = BREACHES[case]
    assert old in MINE
    local = write(tmp_path / "stages", {"interior_orientation/mine.py": MINE.replace(old, new)})
    error = breach(find_stages(local), "interior_orientation/mine")
    assert said in error.what
    assert error.where.startswith(str(local / "interior_orientation" / "mine.py"))
    assert error.where.endswith(place)
    assert error.remedy


@pytest.mark.parametrize("base", ["Table", "Artifact"])
@pytest.mark.parametrize("decorator", ["@dataclass", "@dataclass(frozen=True)", "@dataclass(frozen=True, eq=False)"])
def test_a_table_that_is_made_a_dataclass_once_more_is_told_to_leave_that(
    tmp_path: Path, decorator: str, base: str
) -> None:
    head = f"from dataclasses import dataclass\n\nfrom aatri.tables.schema import {base}\n"
    own = f'{decorator}\nclass Mine({base}):\n    """Mine."""\n\n\n'
    text = MINE.replace("from aatri.artifacts.block ", f"{head}from aatri.artifacts.block ")
    text = text.replace("@stage(version=1)\n", own + "@stage(version=1)\n")
    local = write(tmp_path / "stages", {"interior_orientation/mine.py": text})
    error = breach(find_stages(local), "interior_orientation/mine")
    assert error.remedy == "a Table or Artifact is a dataclass by itself: take `@dataclass` off"
    assert "cannot be imported: TypeError" in error.what
    assert error.where.endswith("mine.py:15")


def test_a_folder_with_a_mistyped_role_is_told_the_right_one(tmp_path: Path) -> None:
    local = write(tmp_path / "stages", {"interior_orientatoin/mine.py": MINE})
    error = breach(find_stages(local), "interior_orientatoin/mine")
    assert "declares no ROLE" in error.what
    assert "did you mean 'interior_orientation'" in error.what


def test_installed_stages_come_by_entry_points_without_being_imported(site: Path) -> None:
    install(
        site,
        "interior_orientation/mine = others.film.mine:mine\ngravity = others.gravity\n"
        "gravity/bouguer = others.gravity.bouguer\n",
        {
            "others/__init__.py": "raise RuntimeError\n",
            "others/film/mine.py": MINE,
            "others/gravity/__init__.py": GRAVITY,
            "others/gravity/bouguer.py": BOUGUER,
            "others/gravity/_constants.py": "G = 6.674e-11\n",
        },
    )
    registry = find_stages()
    origin = registry.origins["interior_orientation/mine"]
    assert (origin.source, origin.distribution) == ("installed", "others-stages 2.1")
    assert origin.file == site / "others" / "film" / "mine.py"
    assert first_line(registry, "gravity/bouguer") == "Bouguer."
    assert "others" not in sys.modules
    assert "cannot be imported: RuntimeError" in breach(registry, "interior_orientation/mine").what
    (site / "others" / "__init__.py").write_text("")
    assert registry.card("interior_orientation/mine").version == 1
    assert registry.card("gravity/bouguer").version == 3


def test_an_installed_stage_that_is_there_already_names_package_and_file(site: Path) -> None:
    install(site, "interior_orientation/affine = others2:affine\n", {"others2.py": MINE})
    with pytest.raises(PluginError) as caught:
        find_stages()
    assert "others2.py (others-stages 2.1)" in caught.value.what
    assert "affine.py" in caught.value.what


def test_two_packages_with_one_name_are_an_error_and_the_same_one_twice_is_not(site: Path) -> None:
    install(site, "interior_orientation/mine = others3:mine\n", {"others3.py": MINE})
    install(site, "interior_orientation/mine = others3:mine\n", {}, name="others-again")
    assert "interior_orientation/mine" in find_stages().variants
    install(site, "interior_orientation/mine = others4:mine\n", {"others4.py": MINE}, name="third")
    with pytest.raises(PluginError, match="there twice"):
        find_stages()


@pytest.mark.parametrize("name", ["interior_orientation", "Interior/mine", "a/b/c", "interior_orientation/"])
def test_entry_points_that_are_no_stages_are_errors(site: Path, name: str) -> None:
    install(site, f"{name} = others5:mine\n", {"others5.py": MINE})
    with pytest.raises(PluginError) as caught:
        find_stages()
    assert "others-stages 2.1" in caught.value.where + caught.value.what


def test_the_file_of_a_module_is_found_without_importing_it(site: Path) -> None:
    write(site, {"deep/__init__.py": "raise RuntimeError\n", "deep/er/est.py": ""})
    assert file_of_module("deep.er.est") == site / "deep" / "er" / "est.py"
    assert file_of_module("deep.er.none") is None
    assert file_of_module("nothing.at.all") is None
    assert "deep" not in sys.modules


@pytest.mark.parametrize(
    "name", ["os/path", "aatri.stages.block/simulate", "../block/simulate", "block/../block/simulate"]
)
def test_a_name_is_looked_up_and_never_imported(name: str) -> None:
    with pytest.raises(PluginError, match=r"no (role|stage)"):
        find_stages().card(name)
