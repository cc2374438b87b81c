"""Numbers that a search for gross errors proposes, as a table: exchanged ones, and such as fit another point."""

import numpy as np

from aatri.artifacts.solution import ProposedNumbers
from aatri.observations.observed import Observed
from aatri.orientation.bundle.blunders.swaps import are_image_points
from aatri.orientation.bundle.rounds import AdjustedBlock, Key, with_keys


def proposed_numbers(done: AdjustedBlock) -> ProposedNumbers:
    """All proposals of a search."""
    rows: list[tuple[Observed, int, str, bool]] = []
    observed = [o.observed for o in done.result.observations]
    for pair in done.swapped:
        for one, other in (pair, pair[::-1]):
            (o, row), (of_other, other_row) = (_place_of(observed, key) for key in (one, other))
            rows.append((o, row, str(of_other.names(np.array([other_row]))[1][0]), True))
    if done.renumbered and done.inputs.rays is not None:
        o = next(o for o in observed if are_image_points(o, done.inputs.rays))
        rows += [(o, one.row, str(done.inputs.point_ids[one.point]), False) for one in done.renumbered]
    if not rows:
        return ProposedNumbers.empty()
    named = [o.names(np.array([row])) for o, row, _, _ in rows]
    return ProposedNumbers(
        kind=np.array([o.kind for o, _, _, _ in rows]),
        row=np.array([o.row[row] for o, row, _, _ in rows], dtype=np.int32),
        image=np.array([str(image[0]) for image, _ in named]),
        point=np.array([str(point[0]) for _, point in named]),
        proposed=np.array([proposed for _, _, proposed, _ in rows]),
        exchanged=np.array([exchanged for _, _, _, exchanged in rows]),
    )


def _place_of(observed: list[Observed], key: Key) -> tuple[Observed, int]:
    """The observation with a key, and its place in it."""
    return next((o, int(np.argmax(has))) for o in observed if (has := with_keys(o, [key])).any())
