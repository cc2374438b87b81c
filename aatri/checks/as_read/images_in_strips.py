"""Images of strips in their order, with the points that they show: by which checks compare neighbours."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from aatri.arrays import Bool, Float, Int
from aatri.artifacts.block import Block
from aatri.checks.as_read.measured_twice import of_image_and_point
from aatri.checks.limits import COMPARED_POINTS

Complex = npt.NDArray[np.complex128]


@dataclass(frozen=True)
class ImagesInStrips:
    """Images beside each other, and the points that images show, some of them where there are very many."""

    beside: Int
    """(n, 2). The images before and after each in its strip; -1 none."""
    strip: Int
    start: Int
    """(n + 1,). First image point of each image."""
    point: Int
    place_mm: Complex
    """(k,), x + i y. From the middle of the image; by image and point."""

    def telling(self, image: Int, other: Int) -> Int:
        """Neighbours of images that are farther from the others, (m, 2); -1 where one is not."""
        a = self.beside[image]
        farther = (a >= 0) & (a != other[:, None]) & (self.beside[a] != other[:, None, None]).all(axis=2)
        return np.where(farther, a, -1)

    def shown(self, image: int) -> tuple[Int, Complex]:
        """Points of an image, and where they lie."""
        rows = slice(self.start[image], self.start[image + 1])
        return self.point[rows], self.place_mm[rows]

    def distance_mm(self, image: int, other: int) -> float:
        """From the middle of an image to that of another, by their common points."""
        points, others = self.shown(image), self.shown(other)
        _, rows, of_other = np.intersect1d(points[0], others[0], return_indices=True)
        z, w = points[1][rows], others[1][of_other]
        if len(z) < 2:
            return float("nan")
        dz, dw = z - z.mean(), w - w.mean()
        return float(abs(z.mean() - (dw.conj() @ dz) / max((dw.conj() @ dw).real, 1e-30) * w.mean()))

    def swung(self, exchanged: set[int]) -> Int:
        """Strips in most of which two images share more than either does with the one between them.

        An exchanged image may be such a one between.
        """
        between = np.flatnonzero((self.beside >= 0).all(axis=1))
        seen = [
            [self.shown(k)[0] for k in (a, k, b)] for k, (a, b) in zip(between.tolist(), self.beside[between].tolist())
        ]
        share = [[len(np.intersect1d(s[i], s[j])) for i, j in ((0, 2), (0, 1), (1, 2))] for s in seen]
        more = np.array([ends > max(before, after) for ends, before, after in share], dtype=bool)
        n = int(self.strip.max()) + 1
        most = np.maximum(
            0.5 * np.bincount(self.strip[between], minlength=n), np.bincount(self.strip[list(exchanged)], minlength=n)
        )
        return np.flatnonzero(np.bincount(self.strip[between], more, n) > most)


def images_in_strips(block: Block, xy_mm: Float, usable: Bool) -> ImagesInStrips:
    """Images in the order of their strips, with their usable points.

    Parameters
    ----------
    xy_mm : (k, 2) float64, mm
        Image points, from the middle of the image.
    usable : (k,) bool
    """
    images, points = block.images, block.image_points
    order = np.lexsort((images.sequence, images.strip))  # equal ones in the order of their ids, as they are paired
    order = order[images.active[order] & (images.strip[order] >= 0)]
    beside = np.full((len(images), 2), -1)
    following = images.strip[order[1:]] == images.strip[order[:-1]]
    before, after = order[:-1][following], order[1:][following]
    beside[after, 0], beside[before, 1] = before, after
    every = 1 + len(points) // (COMPARED_POINTS * len(images))
    rows = of_image_and_point(block, usable & (points.point % every == 0))
    start = np.searchsorted(points.image[rows], np.arange(len(images) + 1))
    return ImagesInStrips(beside, images.strip, start, points.point[rows], xy_mm[rows] @ np.array([1, 1j]))
