"""Labels that do not cover each other: each takes the first free spot around its point, or is left out."""

from collections.abc import Sequence

from aatri.arrays import Float

CHARACTER_PX = 7.0
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

    def around(self, xy: Float, texts: Sequence[str]) -> list[tuple[float, float, str, str]]:
        """Where labels stand: x, y, anchor and text, right, left, above or below of points (n, 2) as far as is room."""
        written = []
        for (x, y), text in zip(xy.tolist(), texts):
            wide = CHARACTER_PX * len(text)
            for at_x, at_y, left, anchor in (
                (x + AWAY_PX, y + 3, x + AWAY_PX, "start"),
                (x - AWAY_PX, y + 3, x - AWAY_PX - wide, "end"),
                (x, y - AWAY_PX, x - wide / 2, "middle"),
                (x, y + AWAY_PX + LINE_PX - 3, x - wide / 2, "middle"),
            ):
                if self._take((left, at_y - LINE_PX + 2, left + wide, at_y + 2)):
                    written.append((at_x, at_y, anchor, text))
                    break
        return written

    def _take(self, box: Box) -> bool:
        """Whether a place is within the picture and free; then it is taken."""
        outside = box[0] < 0 or box[1] < 0 or box[2] > self.width or box[3] > self.height
        if outside or any(_overlap(box, other) for other in self.taken):
            return False
        self.taken.append(box)
        return True


def _overlap(a: Box, b: Box) -> bool:
    return a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]
