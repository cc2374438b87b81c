"""What a section of the page is made of."""

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TypeVar

from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.solution import Solution
from aatri.report.drawing.picture import Picture
from aatri.report.sections.tables import PageTable, observation_classes

T = TypeVar("T")


@dataclass(frozen=True)
class PageSection:
    """What the page answers to one question, or tells of one stage; `name` is where links lead."""

    name: str
    title: str
    notes: list[str] = field(default_factory=list)
    tables: list[PageTable] = field(default_factory=list)
    pictures: list[Picture] = field(default_factory=list)

    @property
    def empty(self) -> bool:
        """Whether there is nothing to tell."""
        return not (self.notes or self.tables or self.pictures)

    def add(self, other: "PageSection") -> None:
        """Take what another section has."""
        self.notes.extend(other.notes)
        self.tables.extend(other.tables)
        self.pictures.extend(other.pictures)

    def of_stage(self) -> "PageSection":
        """The section with its name, that of a stage, before all that it has."""
        return replace(
            self,
            notes=[f"{self.name}: {note}" for note in self.notes],
            tables=[replace(t, caption=f"{self.name}: {t.caption}") for t in self.tables],
            pictures=[replace(p, name=f"{p.name}_{self.name}", title=f"{p.title}, {self.name}") for p in self.pictures],
        )

    def in_metres(self, metric: bool) -> "PageSection":
        """The section with pictures that know whether metres are metres."""
        return replace(self, pictures=[replace(picture, metric=metric) for picture in self.pictures])

    def in_short(self) -> "PageSection":
        """The section with its first two pictures, without tables."""
        return replace(self, tables=[], pictures=self.pictures[:2])


@dataclass(frozen=True)
class Surroundings:
    """What sections draw from besides their own artifact."""

    block: Block | None
    image_points: ImagePoints | None
    solution: Solution | None

    @cached_property
    def classes(self) -> PageTable | None:
        """Observations of the solution by kind: drawn up once, for all that show them."""
        return observation_classes(self.solution) if self.solution is not None else None


def present(*items: T | None) -> list[T]:
    """Those that are there."""
    return [item for item in items if item is not None]
