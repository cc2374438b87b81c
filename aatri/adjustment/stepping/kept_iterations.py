"""Iterations that are kept: an adjustment that was killed goes on at the last that it factorised, to the same bits.

Kept are the values of all groups, the damping, the curvature of the losses, the blocks that are slowed down, and the
history; the linearisation there is computed again. Chord steps, which go on from an earlier factor, are repeated. The
adjustments of a stage are numbered in their order, which the same inputs repeat; those that came to their end before
are gone through again by their last iterations. What is kept belongs to its start: an adjustment that begins otherwise
does not take it.
"""

import dataclasses
import hashlib
import json
import time
from typing import Any

import numpy as np
import numpy.typing as npt

from aatri.adjustment.constraints.multipliers import factorise_constrained
from aatri.adjustment.stepping.adjusted import Step
from aatri.adjustment.stepping.damping import Damping
from aatri.adjustment.stepping.iteration import IterationState
from aatri.adjustment.stepping.robust import curvature_of, with_curvature
from aatri.adjustment.unknowns import State
from aatri.notes import Note
from aatri.progress import Checkpoint


class KeptIterations:
    """The iterations of one adjustment, kept at most every so many seconds."""

    def __init__(self, checkpoint: Checkpoint, start: State) -> None:
        self._checkpoint, self._clock = checkpoint, time.monotonic()
        self._name = checkpoint.numbered("iterations")
        self._start = _digest(start) if np.isfinite(checkpoint.every_s) else np.zeros(0, np.uint8)

    def keep(self, here: IterationState, history: list[Step], notes: list[Note]) -> None:
        """Keep where the next iteration begins, if that is worth its writing."""
        if time.monotonic() - self._clock < self._checkpoint.every_s:
            return
        notes_text = json.dumps([dataclasses.asdict(note) for note in notes], default=str)
        self._checkpoint.save(
            self._name,
            {
                "start": self._start,
                "damping": np.array(dataclasses.astuple(here.damping)),
                "strayed": np.array(here.strayed),
                "curvature": np.array(curvature_of(here.problem)),
                "hold": here.problem.hold,
                "history": np.array([dataclasses.astuple(step) for step in history], dtype=np.float64),
                "notes": np.array(notes_text),
                **{f"state {name}": values for name, values in arrays_of(here.state).items()},
            },
        )
        self._clock = time.monotonic()

    def latest(self, first: IterationState) -> tuple[IterationState, list[Step], list[Note]] | None:
        """Where an earlier attempt had come to, from what it began with; None if it kept nothing."""
        kept = self._checkpoint.load(self._name) if np.isfinite(self._checkpoint.every_s) else None
        if kept is None or not np.array_equal(kept["start"], self._start):
            return None
        problem = with_curvature(dataclasses.replace(first.problem, hold=kept["hold"]), float(kept["curvature"]))
        state = state_of(first.state, {k.removeprefix("state "): v for k, v in kept.items() if k.startswith("state ")})
        damping = Damping(*kept["damping"].tolist())
        factored = factorise_constrained(problem, state, damping.value)
        history = [Step(cost, decrement, by, bool(off)) for cost, decrement, by, off in kept["history"].tolist()]
        notes = [Note(**{**note, "ids": tuple(note["ids"])}) for note in json.loads(str(kept["notes"]))]
        return IterationState(problem, state, factored, damping, bool(kept["strayed"])), history, notes


def arrays_of(state: State) -> dict[str, npt.NDArray[Any]]:
    """The arrays of all groups: a group is an array, or fields that are."""
    arrays: dict[str, npt.NDArray[Any]] = {}
    for name, value in state.items():
        if dataclasses.is_dataclass(value) and not isinstance(value, type):
            arrays |= {f"{name}.{f.name}": getattr(value, f.name) for f in dataclasses.fields(value)}
        else:
            arrays[name] = np.asarray(value)
    return arrays


def state_of(like: State, arrays: dict[str, npt.NDArray[Any]]) -> dict[str, Any]:
    """The groups of arrays."""
    state: dict[str, Any] = {}
    for name, value in like.items():
        if dataclasses.is_dataclass(value) and not isinstance(value, type):
            fields = {f.name: arrays[f"{name}.{f.name}"] for f in dataclasses.fields(value)}
            state[name] = dataclasses.replace(value, **fields)
        else:
            state[name] = arrays[name]
    return state


def _digest(start: State) -> npt.NDArray[np.uint8]:
    digest = hashlib.sha256()
    for name, values in sorted(arrays_of(start).items()):
        digest.update(f"{name} {values.dtype} {values.shape} ".encode() + np.ascontiguousarray(values).tobytes())
    return np.frombuffer(digest.digest(), dtype=np.uint8)
