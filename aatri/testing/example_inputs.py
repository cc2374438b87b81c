"""Made-up inputs for the ports of any role: a small simulated block, and what the built-in stages make of it.

The block has 3 strips of 5 images, about 200 points, control, check points, observed positions and a few gross errors.
It has been written as a block folder and read again, so that its rows know their file and line; its truth has been put
back. `film` is measured on a comparator, with fiducial marks; `digital` in pixels.
"""

import functools
import tempfile
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from aatri.artifacts.block import Block
from aatri.errors import PluginError
from aatri.formats.tables.writer import write_block
from aatri.pipeline.methods.registry import find_stages
from aatri.plugin import Role
from aatri.tables.schema import Artifact

EXAMPLES = ("film", "digital")

_BLOCK: Mapping[str, Any] = {
    "flight": {"strips": 3, "images_per_strip": 5},
    "ties": {"per_position": 2, "new_points": 180},
    "known": {"full": 12, "check_full": 4},
    "gross_errors": {"image_points": 2},
}
_CAMERAS: Mapping[str, Any] = {
    "film": {"kind": "film", "fiducials": 8},
    "digital": {"kind": "digital", "format": (11500.0, 11500.0), "pixel_size_mm": 0.02},
}
_CHAIN: Mapping[str, tuple[str, Mapping[str, str]]] = {
    "interior": ("interior_orientation/affine", {"block": "block"}),
    "refined": ("image_refinement/systematic", {"block": "block", "image_points": "interior"}),
    "models": ("relative_orientation/dependent", {"block": "block", "image_points": "refined"}),
    "strips": ("strip_formation/scale_transfer", {"block": "block", "models": "models"}),
    "absolute": (
        "absolute_orientation/similarity",
        {"block": "block", "strips": "strips", "image_points": "refined"},
    ),
    "accuracy": ("accuracy/evaluation", {"block": "block", "solution": "absolute"}),
    "calibration": (
        "bundle_adjustment/bundle",
        {"block": "block", "image_points": "refined", "initial": "absolute"},
    ),
}
"""Name -> variant, port -> name."""

_OPTIONS: Mapping[str, Mapping[str, Any]] = {
    "calibration": {"self_calibration": {"set": "brown_conrady"}, "point_covariances": ["*"]}
}

_BY_KIND = {
    "Block": "block",
    "ImagePoints": "refined",
    "Models": "models",
    "Strips": "strips",
    "Solution": "absolute",
    "Evaluation": "accuracy",
}


def example_inputs(role: str, declared: Role, example: str = "film") -> dict[str, Artifact]:
    """An artifact for every port of a role; made once, then kept.

    Parameters
    ----------
    example : {'film', 'digital'}

    Raises
    ------
    PluginError
        If a port takes a kind that the built-in chain does not make.
    """
    inputs = {}
    for port, kind in declared.ports.items():
        if kind.kind == "Information" or port == "other":  # of another block, and the example is one
            continue
        name = _name_of(role, port, kind)
        if name is None:
            raise PluginError(
                f"no example of kind {kind.kind} for port {port} of role {role}",
                remedy="give one: check_stage(..., inputs={PORT: ARTIFACT})",
            )
        inputs[port] = _made(name, example)
    return inputs


def _name_of(role: str, port: str, kind: type[Artifact]) -> str | None:
    if role == "image_refinement" and port == "image_points":
        return "interior"
    if role in ("epochs", "design") and port in ("solution", "earlier"):
        return "calibration"
    return port if port in _OPTIONS else _BY_KIND.get(kind.kind)


def example_folder(folder: Path, example: str = "film", *, shuffle_seed: int | None = None) -> Path:
    """Write the example as a block folder; with `shuffle_seed` the rows of every table are in another order."""
    write_block(_simulated(example), folder)
    if shuffle_seed is not None:
        rng = np.random.default_rng(shuffle_seed)
        for path in sorted(folder.glob("*.csv")):
            head, *rows = path.read_text(encoding="utf-8").splitlines(keepends=True)
            path.write_text(head + "".join(rows[k] for k in rng.permutation(len(rows))), encoding="utf-8")
    return folder


@functools.cache
def example_block(example: str = "film", *, shuffle_seed: int | None = None) -> Block:
    """The example, read from a block folder, with its truth."""
    with tempfile.TemporaryDirectory() as folder:
        reads = find_stages().card("block/tables")
        assert reads.options is not None
        path = example_folder(Path(folder), example, shuffle_seed=shuffle_seed)
        block = reads.function(options=reads.options.model_validate({"path": path}))
        assert isinstance(block, Block)
    true = _simulated(example)
    return replace(block, true_images=true.true_images, true_points=true.true_points, gross_errors=true.gross_errors)


@functools.cache
def _simulated(example: str) -> Block:
    card = find_stages().card("block/simulate")
    assert card.options is not None
    imu = {"observed": example == "digital"}
    options = card.options.model_validate({**_BLOCK, "name": example, "camera": _CAMERAS[example], "imu": imu})
    block = card.function(options=options, rng=np.random.default_rng(1))
    assert isinstance(block, Block)
    return block


@functools.cache
def _made(name: str, example: str) -> Artifact:
    if name == "block":
        return example_block(example)
    variant, ports = _CHAIN[name]
    card = find_stages().card(variant)
    arguments: dict[str, Any] = {port: _made(source, example) for port, source in ports.items()}
    if name in _OPTIONS:
        assert card.options is not None
        arguments["options"] = card.options.model_validate(_OPTIONS[name])
    return card.function(**arguments)
