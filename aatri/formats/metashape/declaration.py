"""What documents of Metashape are recognised by, and what they carry."""

import re

from aatri.formats.metashape.reader import read_metashape
from aatri.formats.metashape.writer import write_metashape
from aatri.formats.parts.format import FileView, Format


def _recognised(view: FileView) -> str:
    if "doc.xml" in view.names and not view.is_folder:
        return "an archive with doc.xml"
    seen = re.search(r"<document\s+version=.*?<chunk", view.head, re.DOTALL)
    if seen:
        return "XML with <document version> and <chunk>"
    seen = re.search(r"<calibration>\s*<projection>", view.head)
    return "XML with <calibration> and <projection>" if seen else ""


METASHAPE = Format(
    "metashape", "Metashape, PhotoScan", _recognised, "XML with <document version> and <chunk>, or a .psz",
    carries=("cameras", "distortion", "image points", "control", "check points", "positions", "start orientations",
             "standard deviations", "rigs", "frame"),
    page="docs/formats.md#metashape-and-photoscan", read=read_metashape, write=write_metashape,
    written=("cameras", "distortion", "control", "check points", "positions", "start orientations",
             "standard deviations", "frame"),
    estimates_cameras=True,
)  # fmt: skip
