"""Labels that do not cover each other: each takes the first free spot around its point, or is left out."""

from collections.abc import Sequence

from markupsafe import Markup

from aatri.arrays import Float
from aatri.report.drawing import svg

CHARACTER_PX = 6.0
LINE_PX = 11.0
AWAY_PX = 8.0

Box = tuple[float, float, float, float]


class Labels:
    """The places taken so far in a picture.

    Parameters
    ----------
    width, height : float, px
        Of the picture: a label lies within it.
    """

    def __init__(self, width: float, height: float) -> None:
        self.width, self.height = width, height
        self.taken: list[Box] = []

    def keep_free(self, xy: Float, half: float) -> None:
        """Do not write over marks of this half width at these points (n, 2)."""
        self.taken += [(x - half, y - half, x + half, y + half) for x, y in xy.tolist()]

    def around(self, xy: Float, texts: Sequence[str], class_: str = "small label") -> tuple[list[Markup], int]:
        """Labels right, left, above or below of points (n, 2), and how many found no room."""
        marks = []
        for (x, y), text in zip(xy.tolist(), texts):
            wide = CHARACTER_PX * len(text)
            spots = (
                (x + AWAY_PX, y + 3, "start"),
                (x - AWAY_PX, y + 3, "end"),
                (x, y - AWAY_PX, "middle"),
                (x, y + AWAY_PX + LINE_PX - 3, "middle"),
            )
            for spot in spots:
                mark = self._write(*spot, wide, text, class_)
                if mark is not None:
                    marks.append(mark)
                    break
        return marks, len(texts) - len(marks)

    def at(self, x: float, y: float, text: str, anchor: str, class_: str) -> list[Markup]:
        """A label at one spot, if it is free."""
        mark = self._write(x, y, anchor, CHARACTER_PX * len(text), text, class_)
        return [] if mark is None else [mark]

    def _write(self, x: float, y: float, anchor: str, wide: float, text: str, class_: str) -> Markup | None:
        left = {"start": x, "end": x - wide, "middle": x - wide / 2}[anchor]
        box = (left, y - LINE_PX + 2, left + wide, y + 2)
        outside = box[0] < 0 or box[1] < 0 or box[2] > self.width or box[3] > self.height
        if outside or any(_overlap(box, other) for other in self.taken):
            return None
        self.taken.append(box)
        return svg.text(x, y, text, class_, anchor)


def _overlap(a: Box, b: Box) -> bool:
    return a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]
