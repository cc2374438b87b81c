"""check_stage finds every breach it names: one bad stage for each."""

from __future__ import annotations

from pathlib import Path

import pytest

from aatri.errors import PluginError
from aatri.pipeline.methods.registry import find_stages
from aatri.tables.digest import content_digest
from aatri.testing.check import SENTENCES, Report, check_stage, examine_stage
from aatri.testing.example_inputs import example_block
from tests.testing.test_beside_truth import FAULTS

HEAD = '''"""Interior orientation as built in, with something wrong.

    x = a0 u + a1 v + a2
"""

import warnings
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImageIds, ImagePoints
from aatri.artifacts.solution import Solution
from aatri.errors import GeometryError
from aatri.plugin import SILENT, Context, Field, Options, stage
from aatri.stages.interior_orientation.affine import affine


class MineOptions(Options):
    """Options."""

    factor: float = Field(1.0, description="factor of the standard deviations")


class Other(ImagePoints):
    def metrics(self):
        return {"verdict": "good"}


def scaled(made, factor):
    return replace(made, measurements=replace(made.measurements, sigma_mm=made.measurements.sigma_mm * factor))


@stage(version=1, uses=("image_points.xy", "fiducial_points.xy"))
def mine(block: Block, *, options: MineOptions = MineOptions(), context: Context = SILENT) -> ImagePoints:
    """Do it."""
    made = scaled(affine(block), options.factor)
'''

BODIES = {
    "runs": ("raise ZeroDivisionError('oh')", "film: ZeroDivisionError: oh"),
    "kind": ("return block", "it returned a Block"),
    "file": ("return Other(**vars(made))", "metrics that are no numbers: {'verdict': 'good'}"),
    "repeatable": ("return scaled(made, np.random.default_rng().uniform(1, 2))", "measurements (sigma_mm)"),
    "truth": ("return scaled(made, 1.0 if block.true_images is None else 2.0)", "measurements (sigma_mm)"),
    "provenance": ("return scaled(made, 1.0 + (block.images.line > 0).mean())", "measurements (sigma_mm)"),
    "order": ("return scaled(made, 1.0 + block.image_points.line[0])", "measurements (sigma_mm)"),
    "photo coordinates": (
        "return replace(made, measurements=replace(made.measurements, xy_mm=-made.measurements.xy_mm))",
        "592 of 592 wrong, by up to 745 times what is allowed; with the sign changed they are right",
    ),
    "standard deviations": ("return scaled(made, 1e3)", "divided by 1000 they are right"),
    "covariances": (
        "return replace(made, interior=replace(made.interior, covariance=-made.interior.covariance))",
        "interior.covariance: 15 of 15 wrong",
    ),
    "rows": ("return replace(made, images=ImageIds(id=made.images.id[::-1]))", "images differ"),
    "inputs": ("x = block.image_points.xy; x.flags.writeable = True; x[0] = 0; return made", "it changed block"),
    "quiet": ("print('hello'); warnings.warn('beware'); return made", "it printed 'hello'; UserWarning at mine.py"),
    "context": ("context.log(3); context.progress(5, 2); return made", "it was told 3; it was told progress 5 of 2"),
    "files": ("Path('left.txt').write_text('x'); return made", "it wrote left.txt"),
}
EDITS = {
    "contract": ("block: Block, *", "blok: Block, *", "asks for port 'blok'"),
    "method": ("    x = a0 u + a1 v + a2\n", "", "there is only a first line"),
    "options": (', description="factor of the standard deviations"', "", "no description: factor"),
    "uses": (', uses=("image_points.xy", "fiducial_points.xy")', "", "it does not say what it uses of block"),
    "defaults": ("MineOptions()", "MineOptions(factor=2.0)", "measurements (sigma_mm)"),
}


OF_OTHER_KINDS = {"rotations", "orientations", "points", "residuals", "figures"}
"""Properties that photo coordinates do not have; each is broken in `test_beside_truth`."""


def examined(folder: Path, text: str, role: str = "interior_orientation") -> Report:
    path = folder / "stages" / role / "mine.py"
    path.parent.mkdir(parents=True)
    path.write_text(text, encoding="utf-8")
    return examine_stage(f"{role}/mine", folder / "stages")


@pytest.mark.slow
def test_a_good_stage_passes_every_check(tmp_path: Path) -> None:
    report = examined(tmp_path, HEAD + "    return made\n")
    assert report.breaches == ()
    assert {check.name for check in report.checks} == set(SENTENCES) - {
        "optional ports",
        *OF_OTHER_KINDS,
    }


@pytest.mark.slow(after=1)
@pytest.mark.parametrize("name", BODIES)
def test_a_breach_of_behaviour_is_found_and_named(tmp_path: Path, name: str) -> None:
    body, said = BODIES[name]
    digest = content_digest(example_block())
    report = examined(tmp_path, f"{HEAD}    {body}\n")
    assert said in {check.name: check.breach for check in report.breaches}[name]
    others = {check.name for check in report.breaches} - {name}
    assert others <= {"provenance": {"order"}, "order": {"provenance"}}.get(name, set())
    assert content_digest(example_block()) == digest  # what a stage does to its inputs does not reach the next check


@pytest.mark.slow(after=1)
@pytest.mark.parametrize("name", EDITS)
def test_a_breach_of_form_is_found_and_named(tmp_path: Path, name: str) -> None:
    old, new, said = EDITS[name]
    assert old in HEAD
    report = examined(tmp_path, HEAD.replace(old, new) + "    return made\n")
    assert said in {check.name: check.breach for check in report.breaches}[name]


def test_an_optional_port_that_is_needed_after_all_is_found(tmp_path: Path) -> None:
    text = HEAD[: HEAD.index("@stage")] + (
        "@stage(version=1, uses=())\n"
        "def mine(block: Block, initial: Solution | None = None) -> Solution:\n"
        '    """Do it."""\n'
        "    return replace(initial)\n"
    )
    report = examined(tmp_path, text, "bundle_adjustment")
    assert [check.name for check in report.breaches] == ["optional ports"]
    assert "TypeError" in report.breaches[0].breach


def test_every_sentence_has_a_stage_that_breaks_it() -> None:
    assert {*BODIES, *EDITS, "optional ports"} == set(SENTENCES) - OF_OTHER_KINDS
    assert {name for *_, name in FAULTS} >= OF_OTHER_KINDS


def test_a_stage_that_takes_neither_example_does_not_run(tmp_path: Path) -> None:
    report = examined(tmp_path, HEAD + "    raise GeometryError('too small')\n")
    assert [check.name for check in report.breaches] == ["runs"]
    assert report.breaches[0].breach == "film: too small; digital: too small"


def test_check_stage_raises_all_breaches_at_once(tmp_path: Path) -> None:
    path = tmp_path / "stages" / "interior_orientation" / "mine.py"
    path.parent.mkdir(parents=True)
    path.write_text(HEAD + "    print('hello'); context.log(''); return made\n", encoding="utf-8")
    with pytest.raises(PluginError) as caught:
        check_stage("interior_orientation/mine", tmp_path / "stages")
    assert caught.value.exit_code == 9
    for part in ("2 of", "quiet:", "it printed 'hello'", "context:", "it was told ''"):
        assert part in str(caught.value)


def test_options_without_a_default_must_be_given() -> None:
    (breach,) = examine_stage("block/tables").breaches
    assert "path must be given" in breach.breach
    (breach,) = examine_stage("interior_orientation/calibrated", options={"limit": 1}).breaches
    assert "takes no options" in breach.breach
    (breach,) = examine_stage("interior_orientation/affine", options={"test_limit": -1}).breaches
    assert "test_limit" in breach.breach


def test_inputs_may_be_given() -> None:
    report = check_stage("interior_orientation/affine", inputs={"block": example_block("digital")})
    assert "order" not in {check.name for check in report.checks}  # the order of files we do not know


def test_a_role_with_a_kind_of_its_own_needs_inputs(tmp_path: Path) -> None:
    role = tmp_path / "stages" / "gravity"
    role.mkdir(parents=True)
    (role / "_kinds.py").write_text(
        "from aatri.tables.schema import Artifact, attribute\n\n\n"
        "class Anomaly(Artifact):\n"
        '    """Gravity anomaly."""\n\n'
        '    kind = "Anomaly"\n'
        '    mgal: float = attribute(unit="mgal", doc="mean anomaly")\n'
    )
    (role / "__init__.py").write_text(
        "from aatri.plugin import Role\n"
        "from ._kinds import Anomaly\n"
        'ROLE = Role(ports={"anomaly": Anomaly}, kind=Anomaly)\n'
    )
    (role / "doubled.py").write_text(
        '"""Twice the anomaly.\n\n    a = 2 g\n"""\n'
        "from aatri.plugin import stage\n"
        "from ._kinds import Anomaly\n\n\n"
        "@stage(version=1)\n"
        "def doubled(anomaly: Anomaly) -> Anomaly:\n"
        '    """Double it."""\n'
        "    return Anomaly(mgal=2 * anomaly.mgal)\n"
    )
    local = tmp_path / "stages"
    (breach,) = examine_stage("gravity/doubled", local).breaches
    assert "no example of kind Anomaly for port anomaly" in breach.breach
    kind = find_stages(local).role("gravity").kind
    report = check_stage("gravity/doubled", local, inputs={"anomaly": kind(mgal=1.5)})
    assert "truth" not in {check.name for check in report.checks}
