"""What the page asks and tells: images, points, where they must be, clicks. All of it as plain values for JSON.

Places on the page are px from the outer corner of the upper left pixel of a file, x right, y down.
"""

from __future__ import annotations

import threading
from collections import OrderedDict
from pathlib import Path
from typing import Any

import numpy as np

from aatri.arrays import Float
from aatri.errors import InputError
from aatri.ids import clipped
from aatri.measuring.measured_folder import CORNER_PX, MeasuredFolder
from aatri.measuring.measured_table import MeasuredRow, RowChange
from aatri.measuring.tiled_picture import TiledPicture

KEPT_PICTURES = 3
"""Pictures that are kept open: the one on the page and those before it."""
MOST_LISTED = 5000
"""Points that are listed; of larger blocks the control and check points alone, others are asked for by their id."""
MOST_CHANGES = 1000
"""Changes that can be undone."""

Values = dict[str, Any]


class Session:
    """A block folder that is being measured; calls may come from several threads."""

    def __init__(self, folder: Path) -> None:
        self.folder = MeasuredFolder(folder)
        self._lock = threading.RLock()
        self._opening = threading.Lock()
        self._pictures: OrderedDict[str, TiledPicture] = OrderedDict()
        self._sizes: dict[str, tuple[int, int]] = {}
        self._changes: OrderedDict[int, tuple[str, str, str, RowChange]] = OrderedDict()
        self._made = 0
        self._version = 0

    def state(self, known: int = -1) -> Values:
        """Images and points with their counts; only the version if it is the one known."""
        with self._lock:
            self._refresh()
            if known == self._version:
                return {"version": known}
            folder, counts, of_image = self.folder, self.folder.points.counts(), self.folder.points.image_counts()
            names = folder.point_names()
            if len(names) > MOST_LISTED:
                names = list(folder.ground)
            return {
                "version": self._version,
                "block": folder.settings.name or folder.folder.resolve().name,
                "run": "",
                "oriented": False,
                "images": [
                    {
                        "name": i,
                        "file": bool(folder.path[i]),
                        "count": of_image.get(i, 0),
                        "marks": list(folder.marks_of(i)),
                    }
                    for i in folder.images
                ],
                "points": [{"name": n, "role": self._role(n), "count": counts.get(n, 0)} for n in names],
            }

    def image(self, image: str) -> Values:
        """Size of an image, and what is measured in it."""
        picture = self._picture(image)
        with self._lock:
            self._refresh()
            size = picture.width, picture.height
            self.folder.to_table(image, size)  # refuses what cannot be measured
            return {
                "width": size[0],
                "height": size[1],
                "levels": picture.levels,
                "rows": [
                    self._shown(row, kind)
                    for kind in ("point", "fiducial")
                    for row in self.folder.table(kind).of_image(image)
                ],
            }

    def point(self, name: str) -> Values:
        """Where a point is measured, and where it must be in the other images."""
        with self._lock:
            self._refresh()
            places = []
            for row in self.folder.points.of_name(name):
                if row.image in self.folder.path:
                    shown = self._shown(row, "point")
                    places.append(
                        {"image": row.image, "name": name, "row": shown, "residual": None, "t": None, "ellipse": None}
                    )
            return {"places": places}

    def marks(self, image: str) -> Values:
        """Where the fiducial marks of an image must be, as far as two measured ones tell."""
        return {"places": [], "image": image}

    def tile(self, image: str, level: int, column: int, row: int) -> bytes:
        """A tile of an image as PNG."""
        return self._picture(image).tile(level, column, row)

    def centre(self, image: str, x: float, y: float, radius: float) -> Values:
        """The centre of a mark near a place."""
        found = self._picture(image).centre(np.array([x, y]) - CORNER_PX, int(np.clip(radius, 2, 100)))
        if found is None:
            what = f"no mark with a centre within {radius:.0f} px"
            raise InputError(what, where=f"image {image}", remedy="set it by hand")
        xy, sigma = found[0] + CORNER_PX, float(found[1].max())
        return {"x": float(xy[0]), "y": float(xy[1]), "sigma": sigma}

    def measure(self, kind: str, image: str, name: str, before: str, x: float, y: float) -> Values:
        """Set a point or mark at a place; `before` is its row as the page has it, empty for a new one."""
        size = self._size(image)
        with self._lock:
            self.folder.check_name(name)
            if kind == "fiducial" and name not in self.folder.marks_of(image):
                raise InputError(
                    f"the camera of image {image} has no fiducial {clipped(name)!r}", remedy="see block.yaml"
                )
            if not (0 <= x <= size[0] and 0 <= y <= size[1]):
                raise InputError(f"({x:.1f}, {y:.1f}) is outside of the image", where=f"image {image}")
            matrix = self.folder.to_table(image, size)
            per_px = float(np.sqrt(abs(np.linalg.det(matrix[:, :2]))))
            cells = self.folder.cells(kind, image, matrix @ [x, y, 1.0], per_px, new=not before)
            return self._kept(kind, image, name, self.folder.table(kind).measure(image, name, before, cells))

    def remove(self, kind: str, image: str, name: str, before: str) -> Values:
        """Take a row out."""
        with self._lock:
            return self._kept(kind, image, name, self.folder.table(kind).remove(image, name, before))

    def undo(self, change: int) -> Values:
        """Bring back what was before a change of this session."""
        with self._lock:
            if change not in self._changes:
                raise InputError("that change cannot be undone any more", remedy="measure it again")
            kind, image, name, done = self._changes[change]
            return self._kept(kind, image, name, self.folder.table(kind).undo(image, name, done))

    def _kept(self, kind: str, image: str, name: str, change: RowChange) -> Values:
        self._made += 1
        self._version += 1
        self._changes[self._made] = kind, image, name, change
        while len(self._changes) > MOST_CHANGES:
            self._changes.popitem(last=False)
        row = next((r for r in self.folder.table(kind).of_image(image) if r.line == change.after), None)
        shown = self._shown(row, kind) if row else None
        return {"change": self._made, "kind": kind, "image": image, "name": name, "row": shown}

    def _refresh(self) -> None:
        """See what others have written."""
        if any([self.folder.points.refresh(), self.folder.marks.refresh()]):
            self._version += 1

    def _role(self, name: str) -> str:
        ground = self.folder.ground.get(name)
        return ground.role if ground else ""

    def _shown(self, row: MeasuredRow, kind: str) -> Values:
        """A row on the page."""
        x, y = self._on_page(row.image, np.array(row.xy)).tolist()
        of = "mark" if kind == "fiducial" else self._role(row.name) or "tie"
        return {"kind": kind, "name": row.name, "of": of, "x": x, "y": y, "line": row.line, "active": row.active}

    def _on_page(self, image: str, xy: Float) -> Float:
        matrix = self.folder.to_table(image, self._size(image))
        return np.asarray(np.linalg.solve(matrix[:, :2], xy - matrix[:, 2]))

    def _size(self, image: str) -> tuple[int, int]:
        if image not in self._sizes:
            self._picture(image)
        return self._sizes[image]

    def _picture(self, image: str) -> TiledPicture:
        path = self.folder.path.get(image)
        if not path:
            what = "has no path in images.csv" if image in self.folder.path else "is not in images.csv"
            raise InputError(
                f"image {clipped(image)!r} {what}", where=str(self.folder.folder), remedy="name its file there"
            )
        with self._opening:
            if image not in self._pictures:
                self._pictures[image] = TiledPicture(path)
                while len(self._pictures) > KEPT_PICTURES:
                    self._pictures.popitem(last=False)
            self._pictures.move_to_end(image)
            picture = self._pictures[image]
            self._sizes[image] = picture.width, picture.height
            return picture
