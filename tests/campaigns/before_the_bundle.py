"""Gross errors in the block of the demo, and what the stages before the bundle find of them.

    python -m tests.campaigns.before_the_bundle --count 4 [--first 1]

Each seed is one block of which 1 % of all image points are off by 10 to 1,000 sigma, and 1 % have exchanged their
numbers with another of their image. Relative orientation is counted by point and pair: an error counts as one that it
should find where it changes the distance from coplanarity (true orientation, in standard deviations, times the root of
the redundancy number of the condition) by more than twice the minimal detectable one. Strip formation by point and
joint: what relative orientation has left, where it changes the logarithm of the scale by as much. A rejection is right
if the point is wrong in an image of the pair, or of the joint; recall and precision are of both stages together. `left`
are wrong image points that are not themselves rejected when the bundle begins. Each is one of these:

- `named in the other image`: a pair with it has rejected the point, and the suspect is the measurement in the right
  image, since a pair cannot tell left from right; `named as tie`: a joint or the strip block has rejected the point;
- `listed`: in the table `uncontrolled` of the strip block: no second model, strip or control sees it;
- `small`: below twice the minimal detectable error in every pair and joint that it is in;
- `missed`: none of these; it should be 0.

`found by the bundle`: the share of those above twice the minimal detectable error of the bundle that stay out in the
end. A line ends with what is not as it should be: recall and precision below 95 %, `missed`, more than 6 iterations.
"""

from __future__ import annotations

import argparse
import sys
from typing import Any

import numpy as np

from aatri.adapters.pairs.image_pairs import neighbouring_images, pair_names, pairs_of
from aatri.geometry.coplanarity import sampson
from aatri.geometry.intersection import intersect_pair
from aatri.geometry.vectors import tangents
from aatri.orientation.relative.orientations import ImagePairs
from aatri.stages.bundle_adjustment.bundle import BundleOptions
from tests.campaigns.gross_errors import DELTA0, Spoilt, _above, image_points, stays_out
from tests.orientation.strips.reference import ModelRows, log_scales
from tests.stages.chain import Chain, run_chain, simulated


def exchanged(block: Any, rng: np.random.Generator) -> Any:
    """1 % of all image points with the number of another of their image; the rows."""
    from dataclasses import replace

    m, rows = block.image_points, list[int]()
    xy = m.xy.copy()
    while len(rows) < 0.01 * len(m):
        one = int(rng.integers(len(m)))
        two = int(rng.choice(np.flatnonzero(m.image == m.image[one])))
        if one != two and one not in rows and two not in rows:
            xy[[one, two]] = xy[[two, one]]
            rows += [one, two]
    return replace(block, image_points=replace(m, xy=xy)), np.array(rows)


def true_pair(block: Any, pairs: ImagePairs, k: int) -> tuple[Any, Any]:
    """Relative orientation of a pair from the truth."""
    R, X = block.true_images.ground_from_image, block.true_images.position_m
    i, j = int(pairs.left[k]), int(pairs.right[k])
    b = R[i].T @ (X[j] - X[i])
    return R[i].T @ R[j], b / np.linalg.norm(b)


def detectable(clean: Chain, spoilt: Chain) -> tuple[ImagePairs, Any]:
    """Pairs of the spoilt block, and which (point, pair) relative orientation should find."""
    images = neighbouring_images(clean.block)
    pairs, after = (pairs_of(c.block, c.refined, images) for c in (clean, spoilt))
    assert np.array_equal(pairs.point, after.point)
    large = np.zeros(len(pairs.point), dtype=bool)
    for k in range(len(pairs.left)):
        mine = np.arange(pairs.start[k], pairs.start[k + 1])
        R, b = true_pair(clean.block, pairs, k)
        v, J = sampson(R, b, tangents(b), pairs.rays.take(mine))
        w, _ = sampson(R, b, tangents(b), after.rays.take(mine))
        r = 1.0 - np.einsum("ni,ij,nj->n", J, np.linalg.inv(J.T @ J), J)
        large[mine] = np.abs(w - v) * np.sqrt(np.maximum(r, 0.0)) > 2 * DELTA0
    return after, large


def joints(clean: Chain, spoilt: Chain, after: ImagePairs, active: Any) -> tuple[Any, Any, Any]:
    """Second pair, point, and whether strip formation should find it, of the points that orientation has left."""
    before = pairs_of(clean.block, clean.refined, neighbouring_images(clean.block))
    found = []
    for b in range(1, len(after.left)):
        a = b - 1
        if after.right[a] != after.left[b]:
            continue
        at = [np.arange(after.start[k], after.start[k + 1]) for k in (a, b)]
        at = [rows[active[rows]] for rows in at]
        _, of_a, of_b = np.intersect1d(after.point[at[0]], after.point[at[1]], return_indices=True)
        observed = []
        for pairs in (before, after):
            models = []
            for k, rows in ((a, at[0][of_a]), (b, at[1][of_b])):
                R, base = true_pair(clean.block, pairs, k)
                X = intersect_pair(R, base, pairs.rays.take(rows))
                n = len(rows)
                models.append(
                    ModelRows(X.xyz, X.covariance, np.tile(base, (n, 1)), np.tile(R, (n, 1, 1)), np.zeros((n, 5, 5)))
                )
            observed.append(log_scales(*models)[:2])
        change = np.abs(observed[1][0] - observed[0][0]) / observed[0][1] * np.sqrt(1.0 - 1.0 / max(len(of_a), 2))
        found.append((np.full(len(of_a), b), after.point[at[1][of_b]], change > 2 * DELTA0))
    return tuple(np.concatenate(part) for part in zip(*found))


def judged(clean: Chain, spoilt: Chain, wrong: Any) -> dict[str, float]:
    """Figures of one block."""
    block, n_points = spoilt.block, len(spoilt.block.points)
    after, large = detectable(clean, spoilt)
    bad = np.zeros(len(block.image_points), dtype=bool)
    bad[wrong] = True
    of_pair = np.repeat(np.arange(len(after.left)), np.diff(after.start))
    o, p = spoilt.models.orientations, spoilt.models.model_points
    pair_of = {(int(i), int(j)): k for k, (i, j) in enumerate(zip(after.left, after.right))}
    model = np.array([pair_of[int(i), int(j)] for i, j in zip(o.left, o.right)])
    kept = np.isin(of_pair * n_points + after.point, model[p.model[p.active]] * n_points + p.point[p.active])
    is_wrong = bad[after.left_row] | bad[after.right_row]
    oriented = {
        "pairs wrong": int(large.sum()),
        "found": int((~kept & large).sum()),
        "pairs rejected": int((~kept).sum()),
        "of these": int((~kept & is_wrong).sum()),
    }
    second, point, should = joints(clean, spoilt, after, kept)
    s = spoilt.strips.suspects
    ties = (s.kind == "model_tie") & s.staying_out
    names = pair_names(block, after)
    id_of = {str(i): k for k, i in enumerate(names)}
    row_of = {str(i): k for k, i in enumerate(block.points.id)}
    out = np.array([id_of[str(m)] * n_points + row_of[str(q)] for m, q in zip(s.image[ties], s.point[ties])], dtype=int)
    rejected = np.isin(second * n_points + point, out)
    image_of, at = block.image_points.image, block.image_points.point
    keys = set((image_of[wrong].astype(np.int64) * n_points + at[wrong]).tolist())
    truly = np.array(
        [
            any(int(i) * n_points + q in keys for i in (after.left[b - 1], after.left[b], after.right[b]))
            for b, q in ((k // n_points, k % n_points) for k in out.tolist())
        ],
        dtype=bool,
    )
    found = int((~kept & large).sum() + (rejected & should).sum())
    right, gone = int((~kept & is_wrong).sum() + truly.sum()), int((~kept).sum() + len(truly))
    both = {
        "joints wrong": int(should.sum()),
        "joints rejected": len(truly),
        "of these right": int(truly.sum()),
        "recall": found / max(int(large.sum() + should.sum()), 1),
        "precision": right / max(gone, 1),
    }
    above = _above(clean, Spoilt(block, "image_point", wrong))
    kept_image_points = ~np.isin(wrong, stays_out(spoilt.strip_block, "image_point"))
    out_at_last = np.isin(wrong, stays_out(spoilt.bundle, "image_point"))
    missed = [
        int(i) * n_points + q
        for b, q in zip(second[should & ~rejected], point[should & ~rejected])
        for i in (after.left[b - 1], after.left[b], after.right[b])
    ]
    why = reasons(spoilt, after, wrong[kept_image_points], kept, large, np.array(missed, dtype=np.int64))
    return {
        **oriented,
        **both,
        "wrong": len(wrong),
        "left": int(kept_image_points.sum()),
        **why,
        "found by the bundle": float((out_at_last & above).sum() / max(above.sum(), 1)),
        "iterations": spoilt.bundle.iterations,
        "sigma0": spoilt.bundle.sigma0,
    }


def reasons(spoilt: Chain, after: ImagePairs, left: Any, kept: Any, large: Any, missed: Any) -> dict[str, int]:
    """How many of the wrong image points that are left for the bundle are so for which reason; the first that holds.

    Parameters
    ----------
    left : (k,) int
        Their rows.
    kept, large : (n,) bool
        Points of the pairs that relative orientation has kept, and those that it should find.
    missed : (m,) int
        Image times the number of points, plus point, of what strip formation should have found and has not.
    """
    block, n = spoilt.block, len(spoilt.block.points)
    m, s, listed = block.image_points, spoilt.strip_block.suspects, spoilt.strip_block.uncontrolled
    assert listed is not None
    ties = np.isin(s.kind, ("model_tie", "strip_tie")) & s.staying_out

    def of_pairs(rows: Any) -> Any:
        return np.isin(left, np.concatenate([after.left_row[rows], after.right_row[rows]]))

    holds = {
        "named in the other image": of_pairs(~kept),
        "named as tie": np.isin(block.points.id[m.point[left]], s.point[ties]),
        "listed": np.isin(left, listed.row[listed.kind == "image_point"]),
        "missed": of_pairs(kept & large) | np.isin(m.image[left].astype(np.int64) * n + m.point[left], missed),
        "small": np.ones(len(left), dtype=bool),
    }
    first = np.argmax(np.stack(list(holds.values())), axis=0)
    return {name: int((first == k).sum()) for k, name in enumerate(holds)}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=4)
    parser.add_argument("--first", type=int, default=1)
    chosen = parser.parse_args()
    failed, options = 0, BundleOptions(interior_unknowns=True)
    for seed in range(chosen.first, chosen.first + chosen.count):
        rng = np.random.default_rng([seed, 99])
        block = simulated(seed, preset="rc30")
        off = image_points(block, rng)
        both, rows = exchanged(off.block, rng)
        figures = judged(run_chain(block, options), run_chain(both, options), np.union1d(off.rows, rows))
        bad = [k for k in figures if k.startswith(("recall", "precision")) and figures[k] < 0.95]
        bad += ["missed"] * (figures["missed"] > 0) + ["iterations"] * (figures["iterations"] > 6)
        text = ", ".join(f"{key} {value:.4g}" for key, value in figures.items())
        sys.stdout.write(f"seed {seed}: {text}{'  NOT GOOD: ' + ', '.join(bad) if bad else ''}\n")
        sys.stdout.flush()
        failed += bool(bad)
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    main()
