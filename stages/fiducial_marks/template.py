"""Fiducial marks found in scanned film by a template: a drawn cross, dot or ring, or a picture cut out of a scan.

    r(p)                                     correlation with the template, turned by some degrees: best and second best
    g(A u + p) + v = a t(u) + b              place by least squares matching, A a similarity, to hundredths of a pixel
    (x, y) = T (u, v) of at least three      similarity on the calibrated marks: which way the film lay in the scanner

The calibrated marks say where to look, in windows of `search_mm` about the places of eight ways of scanning: four
turns, on either side. The way whose marks fit best is taken; where marks that are symmetric leave several, the one
turned least, which is told. A mark counts as found where it correlates by `min_correlation`, the second best place of
its window by no more than `max_second` of that, and where it lies within `max_residual_mm` of the transformation by
all. What is not found is named, and is not measured.

Only windows of a scan are read. Source: Ackermann 1984; Gruen 1985; Kraus, Photogrammetry 1, sec. 3.2.
"""

import json
from typing import Literal

import numpy as np

from aatri.adapters.interior.film_marks import film_images
from aatri.adapters.interior.image_pixels import of_camera, with_fiducials
from aatri.arrays import Float, Int
from aatri.artifacts.block import Block
from aatri.artifacts.features import ScanMarks
from aatri.errors import InputError
from aatri.ids import several, shown
from aatri.pixels.scan_marks import fitting_ways, places_of_ways, scan_marks
from aatri.plugin import SILENT, Context, Field, InputPath, Options, stage
from aatri.progress import Item
from aatri.regular_file import content_of


class TemplateOptions(Options):
    """Options of the search for fiducial marks."""

    shape: Literal["cross", "dot", "ring"] = Field("cross", description="what is drawn as template")
    size_mm: float = Field(2.0, gt=0, description="length of its strokes, or its diameter, mm on the film")
    stroke_mm: float = Field(0.06, gt=0, description="width of its strokes, or of the ring, mm on the film")
    picture: InputPath | None = Field(
        None, description="picture of a mark instead, its centre in the middle of the picture, at the scan's resolution"
    )
    negative: bool | None = Field(
        None, description="the scan is a negative of the template, dark on bright for drawn marks; null: either"
    )
    search_mm: float = Field(4.0, gt=0, description="half side of the window about the place of a mark, mm")
    min_correlation: float = Field(0.8, gt=0, lt=1, description="a mark that is less like its template is not found")
    max_second: float = Field(
        0.75, gt=0, lt=1, description="largest correlation of the second best place, as a share of that of the best"
    )
    max_residual_mm: float = Field(
        0.1, gt=0, description="a mark farther from the transformation by all marks is not found, mm: film deforms less"
    )


SMALLEST_SIGMA_PX = 0.02
"""No mark is measured better, whatever its own residuals say: the edges of real marks are not as drawn."""


@stage(version=1, uses=())
def template(block: Block, *, options: TemplateOptions = TemplateOptions(), context: Context = SILENT) -> Block:
    """Measure the fiducial marks of film images."""
    images = np.flatnonzero(film_images(block) & (block.images.path != ""))
    if not len(images):
        remedy = "name the scans in the column path of images.csv; digital images have no marks"
        raise InputError("no film image with a file", where=block.name, remedy=remedy)
    cameras = np.unique(block.images.camera[images]).tolist()
    places_of_marks = {camera: _places_px(block, camera, options) for camera in cameras}
    picture = "" if options.picture is None else str(options.picture)
    work = []
    for k in images.tolist():
        camera = int(block.images.camera[k])
        size_mm = float(block.cameras.pixel_size_mm[camera].mean())
        settings = {
            "places_px": places_of_marks[camera][0].tolist(),
            "half_px": options.search_mm / size_mm,
            "shape": options.shape,
            "size_px": options.size_mm / size_mm,
            "stroke_px": options.stroke_mm / size_mm,
            "negative": options.negative,
            "picture": content_of(picture),
        }
        key = block.images.content[k], json.dumps(settings, sort_keys=True)
        work.append(Item(str(block.images.id[k]), (str(block.images.path[k]), picture), key))
    scans = context.mapped(scan_marks, work, ScanMarks, "scans")
    rows: list[tuple[int, int, Float, Float]] = []
    for k, kept in zip(images.tolist(), scans):
        camera = int(block.images.camera[k])
        rows += _measured(block, k, kept.load(), places_of_marks[camera], options, context)
    if not rows:
        remedy = "another shape, size_mm or stroke_mm of the template, or a picture of the mark; a larger search_mm"
        raise InputError("no fiducial mark found", where=block.name, remedy=remedy)
    columns = [np.array(column) for column in zip(*rows)]
    return with_fiducials(block, columns[0], columns[1], columns[2], columns[3])


def _places_px(block: Block, camera: int, options: TemplateOptions) -> tuple[Float, Int, Int]:
    """Places of marks from the centre of a scan; by way of scanning (8, m) which of them is which mark; the marks."""
    cameras = block.cameras
    marks = np.flatnonzero(block.fiducials.camera == camera)
    size_mm = cameras.pixel_size_mm[camera]
    if not len(marks) or not np.isfinite(size_mm).all():
        what = f"camera {cameras.id[camera]} has no {'pixel size' if len(marks) else 'calibrated fiducials'}"
        raise InputError(what, where="block.yaml", remedy="give both to the camera")
    near_px = options.search_mm / float(size_mm.mean()) / 4
    return *places_of_ways(block.fiducials.xy_mm[marks] / size_mm, near_px), marks


def _measured(
    block: Block,
    image: int,
    scan: ScanMarks,
    places_of_marks: tuple[Float, Int, Int],
    options: TemplateOptions,
    context: Context,
) -> list[tuple[int, int, Float, Float]]:
    """Image, mark, coordinates and standard deviations of the marks found in a scan, told what was not."""
    (_, place, marks), reading = places_of_marks, scan.marks
    camera, name = int(block.images.camera[image]), str(block.images.id[image])
    size_mm, ids = block.cameras.pixel_size_mm[camera], block.fiducials.id[marks]
    like = np.isfinite(reading.xy_px).all(axis=1) & (np.abs(reading.correlation) >= options.min_correlation)
    like &= reading.second <= options.max_second
    scan_mm = reading.xy_px[place] * size_mm
    used_of_ways, good = fitting_ways(block.fiducials.xy_mm[marks], scan_mm, like[place], options.max_residual_mm)
    if not len(good):
        likest = place[int(np.lexsort((np.abs(reading.correlation[place]).sum(axis=1), like[place].sum(axis=1)))[-1])]
        places = ", ".join(
            f"{m} {abs(reading.correlation[k]):.2f} and {reading.second[k]:.2f}" for m, k in zip(ids, likest)
        )
        context.warn(
            f"{name}: {int(like[likest].sum())} of {len(marks)} fiducial marks found: the image is not measured; "
            f"correlation (at least {options.min_correlation:g}) and share of the second place (at most "
            f"{options.max_second:g}) of {places}"
        )
        return []
    way = int(good[0])
    if len(good) > 1 or way:
        turn = f"{way % 4 * 90} degrees{', mirrored' if way > 3 else ''}"
        fits = several(len(good) - 1, "other way", "fits", "fit")
        others = f"; {fits} as well: marks that lie alike cannot tell" if len(good) > 1 else ""
        (context.log if not way else context.warn)(f"{name}: the film lay turned by {turn}{others}")
    used = used_of_ways[way]
    if not used.all():
        context.warn(f"{name}: fiducial marks not found: {shown(ids[~used].tolist())}")
    at = place[way][used]
    matrix = of_camera(block.cameras, camera, np.array([scan.width_px, scan.height_px], float))
    xy = reading.xy_px[at] @ matrix[:, :2].T + matrix[:, 2]
    sigma_mm = np.maximum(reading.sigma_px[at], SMALLEST_SIGMA_PX) * size_mm
    return [(image, int(m), xy[k], sigma_mm[k]) for k, m in enumerate(marks[used])]
