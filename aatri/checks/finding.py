"""What a check has found: one cause, one sentence, one remedy.

A check takes a block, or a result with its block, and gives findings; a stage reports them with `report`. A finding
says what was seen, of which rows, and what to do about it; alternatives stand beside the cause only where the data
cannot tell them apart. The statistic and its level of significance are those of the test behind it, where it is one.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Literal

from aatri.arrays import Int
from aatri.errors import AatriError, InputError, raise_all
from aatri.ids import shown
from aatri.notes import CONTRADICTION, Note, tell
from aatri.progress import Reporter

Level = Literal["note", "warning", "error"]


@dataclass(frozen=True)
class Finding:
    """One cause, found by one routine."""

    cause: str
    """Name of the file of the check."""
    level: Level
    """A note goes to the log, a warning is what the user should act on, an error ends the stage."""
    sentence: str
    """What is the case, with its figures, without names and remedy; at most 30 words."""
    remedy: str = ""
    """What to do about it."""
    ids: tuple[str, ...] = ()
    """Images, points, models ... it is about, all of them; shown in part where they are many."""
    rows: Mapping[str, Int] = field(default_factory=dict)
    """Mapping of str to (n,). The same as rows of the Block's tables, by kind of observation."""
    where: str = ""
    """`file:line`, image or component it is about."""
    alternatives: tuple[str, ...] = ()
    """Other causes that would explain as much."""
    statistic: float = float("nan")
    significance: float = float("nan")
    """The test behind it: its value, and the probability of as much where all is well; NaN where it is none."""
    contradicts: bool = False
    """The result cannot be right within its standard deviations: the run ends with the exit code of a gate."""
    error: type[AatriError] = InputError
    """What an error is raised as."""

    @property
    def what(self) -> str:
        """The sentence with its alternatives and ids, without place and remedy."""
        head = f"{CONTRADICTION}: {self.sentence}" if self.contradicts else self.sentence
        head = f"{head}: {shown(self.ids)}" if self.ids else head
        return f"{head}; {' or '.join(self.alternatives)} would explain as much" if self.alternatives else head

    @property
    def note(self) -> Note:
        """What the log or the terminal tells of it."""
        return Note("note" if self.level == "note" else "warning", str(self))

    def __str__(self) -> str:
        text = f"{self.where}: {self.what}" if self.where else self.what
        return f"{text}; {self.remedy}" if self.remedy else text


def report(findings: Iterable[Finding | Note], reporter: Reporter) -> None:
    """Tell findings, and notes of methods, in their order: to the log or as warnings; errors are raised after them.

    Raises
    ------
    AatriError
        What findings of level `error` say.
    """
    listed = list(findings)
    tell([f if isinstance(f, Note) else f.note for f in listed if f.level != "error"], reporter)
    errors = [f for f in listed if isinstance(f, Finding) and f.level == "error"]
    if errors:
        raise_all([f.error(f.what, where=f.where, remedy=f.remedy) for f in errors])
