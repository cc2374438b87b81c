"""What is open is counted and named, all of it."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from aatri.adjustment.openness.open_directions import described
from aatri.adjustment.records import Records
from aatri.adjustment.stepping.adjust import adjust_large
from aatri.adjustment.structure import index_problem as preparation
from aatri.adjustment.unknowns import Unknowns, add_step
from aatri.errors import GeometryError


def trilateration(n: int):
    """Distances between all neighbours of a spatial grid of n^3 points, and no datum: six directions are open."""
    xyz = np.stack(np.meshgrid(*[np.arange(n, dtype=float)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    xyz += 0.1 * np.random.default_rng(0).normal(size=xyz.shape)
    near = np.linalg.norm(xyz[:, None] - xyz[None], axis=2) < 1.9
    a, b = np.nonzero(np.triu(near, 1))
    a, b = a.astype(np.int32), b.astype(np.int32)
    wanted = np.linalg.norm(xyz[a] - xyz[b], axis=1)

    def evaluate(state, rows):
        d = state["point"][a[rows]] - state["point"][b[rows]]
        length = np.linalg.norm(d, axis=1)
        J = (d / length[:, None])[:, None, :]
        return (length - wanted[rows])[:, None], (J, -J)

    records = Records(
        "distance", (("point", a), ("point", b)), evaluate, np.full((len(a), 1), 100.0), np.ones(len(a), bool)
    )
    ids = [f"p{k}" for k in range(len(xyz))]
    unknowns = Unknowns("point", np.ones((len(xyz), 3), bool), ("X", "Y", "Z"), ids, add_step, position=xyz)
    return [unknowns], [records], {"point": xyz}


@pytest.mark.parametrize("n", [3, 6])
def test_all_open_directions_of_a_network_without_datum_are_counted(monkeypatch: pytest.MonkeyPatch, n: int) -> None:
    """Three shifts and three rotations; the observations times the unknowns of the larger one were too many before."""
    monkeypatch.setattr(preparation, "DENSE_VERTICES", 20)
    with pytest.raises(GeometryError, match=r"leave 6 unknowns? open: .*of point p"):
        adjust_large(*trilateration(n))


def test_what_is_open_is_named_however_small_the_derivatives(recwarn: pytest.WarningsRecorder) -> None:
    """Products of two diagonals of 1e-200 are zero in double precision."""
    ids, tiny = np.zeros(3, dtype=np.int32), 1e-100

    def evaluate(state, rows):
        v = tiny * (state["value"][0].sum() - np.arange(3.0)[rows])
        return v[:, None], (np.full((len(rows), 1, 2), tiny),)

    records = Records("sum", (("value", ids),), evaluate, np.ones((3, 1)), np.ones(3, bool))
    unknowns = Unknowns("value", np.ones((1, 2), bool), ("a", "b"), ["x"], add_step)
    with pytest.raises(GeometryError, match=r"leave 1 unknowns? open"):
        adjust_large([unknowns], [records], {"value": np.zeros((1, 2))})
    assert not recwarn.list


@pytest.mark.parametrize(
    ("vector", "text"),
    [
        ([[0.0, 1.0], [0.6, 0.9], [0.0, 0.0]], "b, a of image 7, 8"),
        ([[0.0, 1.0], [0.0, 0.9], [0.6, 0.0]], "b of image 7, 8 with a of image 9"),
        ([[0.5, 0.9], [0.6, 0.8], [0.0, 0.0]], "b, a of image 7, 8"),
    ],
)
def test_labels_share_their_blocks_in_a_text_where_they_have_one_in_common(
    vector: list[list[float]], text: str
) -> None:
    unknowns = Unknowns("image", np.ones((3, 2), bool), ("a", "b"), ["7", "8", "9"], add_step)
    layout = SimpleNamespace(columns=lambda name, size: np.arange(6).reshape(3, 2))
    problem = SimpleNamespace(unknowns=(unknowns,), layout=layout)
    assert described(problem, np.array(vector).ravel()).text == text  # type: ignore[arg-type]
