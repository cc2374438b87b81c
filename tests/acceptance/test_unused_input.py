"""What is read, documented and then used by no stage is refused, as a user meets it."""

from __future__ import annotations

import functools
from collections.abc import Callable
from pathlib import Path

import pytest

from aatri.pipeline.methods.registry import find_stages
from tests.acceptance.small_block import aatri, current


def _column(path: Path, name: str, value: str) -> None:
    """The column filled, added where it is not there."""
    header, *rows = path.read_text().splitlines()
    names = header.split(",")
    at = names.index(name) if name in names else len(names)
    cells = [row.split(",") for row in rows]
    table = [[*names[:at], name, *names[at + 1 :]], *([*row[:at], value, *row[at + 1 :]] for row in cells)]
    path.write_text("\n".join(",".join(row) for row in table) + "\n")


def _attitudes(block: Path) -> None:
    for name, value in (("a1", "3.0"), ("a2", "0.0"), ("a3", "0.0"), ("s1", "1e-4"), ("s2", "1e-4"), ("s3", "1e-4")):
        _column(block / "exterior.csv", name, value)
    text = (block / "block.yaml").read_text()
    assert "sigma_angle" in text or "units: {" in text
    if "sigma_angle" not in text:
        (block / "block.yaml").write_text(text.replace("units: {", "units: {sigma_angle: deg, ", 1))


def _scale_bar(block: Path) -> None:
    (block / "relative_control.yaml").write_text(
        "- {type: distance, points: [GCP01, GCP02], value: 4000, sigma: 0.001}\n"
    )


def _geodetic(kind: str) -> str:
    return f"type,from,to,value,sigma\n{kind},GCP01,GCP02,4000,0.001\n"


def _camera(key: str, value: str) -> Callable[[Path], None]:
    def edit(block: Path) -> None:
        path = block / "block.yaml"
        kept = [line for line in path.read_text().splitlines() if not line.lstrip().startswith(f"{key}:")]
        at = next(k for k, line in enumerate(kept) if line.lstrip().startswith("principal_distance:"))
        path.write_text("\n".join([*kept[:at], f"    {key}: {value}", *kept[at:]]) + "\n")

    return edit


CASES = {
    "relative_control:distance": (_scale_bar, "relative_control.yaml"),
    "geodetic:distance": (lambda b: (b / "geodetic.csv").write_text(_geodetic("distance")), "geodetic.csv:2"),
    "geodetic:azimuth": (lambda b: (b / "geodetic.csv").write_text(_geodetic("azimuth")), "geodetic.csv:2"),
    "exterior.angles_rad": (_attitudes, "exterior.csv: a1, a2, a3"),
    "exterior.drift_group": (lambda b: _column(b / "exterior.csv", "drift_group", "g"), "exterior.csv: drift_group"),
    "cameras.boresight_rad:without_angles": (_camera("boresight", "[0.1, 0.0, 0.0]"), "block.yaml: boresight"),
    "cameras.mount_deg:without_effect": (_camera("mount", "90"), "block.yaml: mount"),
    "cameras.lever_arm_m:without_antenna": (_camera("lever_arm", "[0.1, 0.0, 0.0]"), "block.yaml: lever_arm"),
    "image_points.row_time_s": (lambda b: _column(b / "image_points.csv", "row_time", "0.01"), "row_time"),
}


@functools.cache
def _used() -> set[str]:
    cards = [
        find_stages().card(name)
        for name in ("absolute_orientation/similarity", "strip_adjustment/polynomial", "bundle_adjustment/bundle")
    ]
    return {name for card in cards for name in card.used_with(card.options() if card.options else None) or ()}


@pytest.mark.slow(after=1)
@pytest.mark.parametrize("name", CASES)
def test_what_no_stage_uses_is_refused_with_file_column_and_remedy(project: Path, name: str) -> None:
    edit, place = CASES[name]
    edit(project / "block")
    result = aatri("run", "-q", "--until", "interior")
    if name in _used():
        assert result.exit_code == 0, result.stderr
        return
    assert result.exit_code == 3, result.stderr
    assert place in result.stderr
    assert "without effect" in result.stderr
    assert "ignore: [" in result.stderr
    assert current(project) == {"block"}


def test_ignored_it_is_a_warning_on_the_terminal_and_in_the_report(project: Path) -> None:
    _camera("mount", "90")(project / "block")
    path = project / "pipeline.yaml"
    path.write_text("ignore: [cameras.mount_deg:without_effect]\n" + path.read_text())
    result = aatri("run", "-q", "--until", "interior")
    assert result.exit_code == 0, result.stderr
    assert "warning: block: camera rc30: mounts of" in result.stderr
    assert "mounts of" in (project / "run" / "report.html").read_text()
