"""What a section of the page is made of."""

from dataclasses import dataclass, field
from typing import TypeVar

from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.solution import Solution
from aatri.report.drawing.svg import Picture
from aatri.report.sections.tables import PageTable
from aatri.report.view.run_view import StageView

T = TypeVar("T")


@dataclass(frozen=True)
class PageSection:
    """What the page tells of one stage."""

    stage: StageView
    seconds: str
    notes: list[str] = field(default_factory=list)
    tables: list[PageTable] = field(default_factory=list)
    pictures: list[Picture] = field(default_factory=list)


@dataclass(frozen=True)
class Surroundings:
    """What sections draw from besides their own artifact."""

    block: Block | None
    image_points: ImagePoints | None
    solution: Solution | None


def present(*items: T | None) -> list[T]:
    """Those that are there."""
    return [item for item in items if item is not None]
