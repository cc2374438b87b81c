"""What the page asks and tells: images, points, where they must be, clicks. All of it as plain values for JSON.

Places on the page are px from the outer corner of the upper left pixel of a file, x right, y down.
"""

import contextlib
import threading
import time
from collections import OrderedDict
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from aatri.arrays import Float
from aatri.errors import AatriError, InputError
from aatri.ids import canonical, clipped
from aatri.measuring.centres import place_of_mark
from aatri.measuring.measured_folder import CORNER_PX, MeasuredFolder
from aatri.measuring.measured_table import MeasuredRow, RowChange
from aatri.measuring.orientation import Click, PlaceInImage, RunOrientation
from aatri.measuring.run_of_folder import orientation_of, runs_near, stamp_of
from aatri.measuring.tiled_picture import OpenPictures

MOST_LISTED = 5000
"""Points that are listed; of larger blocks control and check points and those measured on the page."""
MOST_CHANGES = 1000
"""Changes that can be undone."""
SHOWN_SIGMAS = 3.03
"""Half axes of an ellipse that holds 99 % of the places, in standard deviations: sqrt(-2 ln 0.01)."""
LOOKED_EVERY_S = 3.0
"""Between looks for a newer run."""

Values = dict[str, Any]


class Session:
    """A block folder that is being measured; calls may come from several threads."""

    def __init__(self, folder: Path, run: Path | None = None) -> None:
        """Read a folder, and the run named, else the newest that oriented its images, as far as there is one."""
        self.folder = MeasuredFolder(folder)
        self._asked, self._run = run, run
        self._orientation: RunOrientation | None = None
        self._stamp: tuple[float, ...] = ()
        self._looked_s = -np.inf
        if run is not None:
            self._orientation, self._stamp = orientation_of(run, self.folder.images), stamp_of(run)
        self._lock = threading.RLock()
        self.pictures = OpenPictures(self.folder)
        self._changes: OrderedDict[int, tuple[str, str, str, RowChange]] = OrderedDict()
        self._made = 0
        self._version = 0

    def state(self, known_version: int = -1) -> Values:
        """Images and points with their counts; only the version if it is the one known."""
        with self._lock:
            self._refresh()
            if known_version == self._version:
                return {"version": known_version}
            folder, counts, of_image = self.folder, self.folder.points.counts(), self.folder.points.image_counts()
            names = list(dict.fromkeys([*folder.ground, *(name for _, _, name, _ in self._changes.values())]))
            if len(counts) <= MOST_LISTED:
                names = [*folder.ground, *canonical(set(counts) - set(folder.ground))]
            return {
                "version": self._version,
                "block": folder.settings.name or folder.folder.resolve().name,
                "run": self._told_of_run(),
                "oriented": self._orientation is not None,
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
        picture = self.pictures.open(image)
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
            rows = {row.image: row for row in self.folder.points.of_name(name) if row.image in self.folder.path}
            there = self._places(name, rows)
            shown = [
                self._placed(i, name, rows.get(i), there.get(i)) for i in self.folder.images if i in rows or i in there
            ]
            return {"places": [place for place in shown if place]}

    def _places(self, name: str, rows: Mapping[str, MeasuredRow]) -> dict[str, PlaceInImage]:
        if self._orientation is None:
            return {}
        ground = self.folder.ground.get(name)
        control = None
        if ground is not None and ground.role != "point":
            control = self._orientation.control(ground.xyz_m, ground.covariance_m2, self.folder.crs)
        clicks = [
            Click(row.image, np.array(row.xy), self.folder.sigma_mm(row, "point"))
            for row in rows.values()
            if row.active
        ]
        return self._orientation.places(name, clicks, control)

    def _placed(self, image: str, name: str, row: MeasuredRow | None, there: PlaceInImage | None) -> Values | None:
        """A place on the page; None where it lies outside of the image, or there is no file."""
        if not self.folder.path[image]:
            return None
        size = self.pictures.size(image)
        values: Values = {
            "image": image,
            "name": name,
            "row": None,
            "ellipse": None,
            "sigma": None,
            "residual": None,
            "t": None,
        }
        if row is not None:
            values["row"] = self._shown(row, "point")
        if there is None:
            return values
        x, y = self._on_page(image, there.xy).tolist()
        if row is None and not (0 <= x <= size[0] and 0 <= y <= size[1]):
            return None
        to_px = np.linalg.inv(self.folder.to_table(image, size)[:, :2])
        C = to_px @ there.covariance @ to_px.T
        values |= {"x": x, "y": y, "wrong": there.wrong, "t": there.t}
        if np.isfinite(C).all():
            variances, axes = np.linalg.eigh(C)
            a, b = (SHOWN_SIGMAS * np.sqrt(np.maximum(variances[::-1], 0.0))).tolist()
            values |= {"ellipse": [a, b, float(np.arctan2(axes[1, 1], axes[0, 1]))], "sigma": a / SHOWN_SIGMAS}
        if there.off is not None:
            values["residual"] = (to_px @ there.off).tolist()
        return values

    def marks(self, image: str) -> Values:
        """Where the fiducial marks of an image are measured, and where they must be as far as two others tell."""
        with self._lock:
            self._refresh()
            nominal = {name: complex(*xy) for name, xy in self.folder.marks_of(image).items()}
            shown = {row.name: self._shown(row, "fiducial") for row in self.folder.marks.of_image(image)}
            at = {name: complex(row["x"], row["y"]) for name, row in shown.items() if name in nominal}
            places = []
            for name, film in nominal.items():
                z = place_of_mark(film, [(nominal[n], at[n]) for n in at if n != name])
                place: Values = {
                    "image": image,
                    "name": name,
                    "row": shown.get(name),
                    "ellipse": None,
                    "sigma": None,
                    "t": None,
                }
                off = at[name] - z if name in at and z is not None else None
                place["residual"] = None if off is None else [off.real, off.imag]
                if z is not None:
                    place |= {"x": z.real, "y": z.imag}
                if z is not None or name in at:
                    places.append(place)
            return {"places": places}

    def tile(self, image: str, level: int, column: int, row: int) -> bytes:
        """A tile of an image as PNG."""
        return self.pictures.open(image).tile(level, column, row)

    def centre(self, image: str, x: float, y: float, radius: float) -> Values:
        """The centre of a mark near a place."""
        centre = self.pictures.open(image).centre(np.array([x, y]) - CORNER_PX, int(np.clip(radius, 2, 100)))
        if centre is None:
            what = f"no mark with a centre within {radius:.0f} px"
            raise InputError(what, where=f"image {image}", remedy="set it by hand")
        xy, sigma = centre[0] + CORNER_PX, float(centre[1].max())
        return {"x": float(xy[0]), "y": float(xy[1]), "sigma": sigma}

    def measure(self, kind: str, image: str, name: str, before: str, x: float, y: float) -> Values:
        """Set a point or mark at a place; `before` is its row as the page has it, empty for a new one."""
        picture = self.pictures.open(image)
        size = picture.width, picture.height
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
        """See what others have written: the tables by an editor or another page, results by a run."""
        if any([self.folder.points.refresh(), self.folder.marks.refresh(), self.folder.refresh_ground()]):
            self._version += 1
        if self._run is not None and stamp_of(self._run) == self._stamp:
            return
        if time.monotonic() - self._looked_s < LOOKED_EVERY_S:
            return
        self._looked_s = time.monotonic()
        for run in [self._asked] if self._asked else runs_near(self.folder.folder):
            stamp = stamp_of(run)
            with contextlib.suppress(AatriError, OSError):  # half-done: the last one serves until there is a result
                self._orientation = orientation_of(run, self.folder.images)
                self._run, self._stamp = run, stamp
                self._version += 1
                return

    def _told_of_run(self) -> str:
        if self._orientation is None:
            return "no run yet: after a run the page knows where points must be"
        method = self._orientation.solution.method
        return f"places by {self._run}, {method}"

    def _role(self, name: str) -> str:
        ground = self.folder.ground.get(name)
        return ground.role if ground else ""

    def _shown(self, row: MeasuredRow, kind: str) -> Values:
        """A row on the page."""
        x, y = self._on_page(row.image, np.array(row.xy)).tolist()
        role = "mark" if kind == "fiducial" else self._role(row.name) or "tie"
        return {"kind": kind, "name": row.name, "of": role, "x": x, "y": y, "line": row.line, "active": row.active}

    def _on_page(self, image: str, xy: Float) -> Float:
        matrix = self.folder.to_table(image, self.pictures.size(image))
        return np.asarray(np.linalg.solve(matrix[:, :2], xy - matrix[:, 2]))
