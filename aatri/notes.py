"""What a method has to say beside its result: notes, returned with the result and told once by the stage.

Methods compute and return; they neither log nor warn. A note says in words what happened and names the ids it is
about. The stage tells all notes of a result with `tell`: a `note` goes to the log, a `warning` also to the terminal,
the record, the artifact and the report.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

from aatri.ids import shown
from aatri.progress import Reporter

Level = Literal["note", "warning"]

CONTRADICTION = "the result contradicts its own tests"
"""How a warning begins that tells of a model error with an effect beyond the standard deviations of the result."""

REJECTED = "rejected as gross errors"
"""What a warning says of observations that the report names by the suspects of the result."""

EXCHANGED = "these two fit if their numbers are exchanged"
"""What a warning says of two observations whose exchange `aatri edit` proposes."""

FAR_OFF = "far off what their standard deviations allow"
"""What a warning says of check points that a light of the report names."""


@dataclass(frozen=True)
class Note:
    """One thing to say."""

    level: Level
    """A warning is what the user must see."""
    text: str
    """One sentence, without the ids."""
    ids: tuple[str, ...] = ()
    """Images, points, models ... it is about, all of them; told in part where they are many."""
    sets_aside: bool = False
    """It tells of images or points that take no part because nothing determines them, at least where what is left is
    adjusted again."""

    def __str__(self) -> str:
        return f"{self.text}: {shown(self.ids)}" if self.ids else self.text


def tell(notes: Iterable[Note], reporter: Reporter) -> None:
    """Tell notes in their order: notes to the log, warnings as warnings."""
    for note in notes:
        if note.level == "warning":
            reporter.warn(str(note))
        else:
            reporter.log(str(note))
