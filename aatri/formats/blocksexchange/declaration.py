"""What BlocksExchange XML is recognised by, and what it carries."""

from aatri.formats.blocksexchange.reader import read_blocksexchange
from aatri.formats.blocksexchange.writer import write_blocksexchange
from aatri.formats.parts.format import FileView, Format


def _recognised(view: FileView) -> str:
    return "XML with BlocksExchange" if "<BlocksExchange" in view.head else ""


BLOCKSEXCHANGE = Format(
    "blocksexchange", "BlocksExchange XML", _recognised, "XML with `BlocksExchange`",
    carries=("cameras", "distortion", "image points", "control", "check points", "start values of points",
             "start orientations", "frame", "standard deviations"),
    drops=("covariances", "strips", "times", "rigs", "film"),
    page="docs/formats.md#blocksexchange", read=read_blocksexchange, write=write_blocksexchange,
    written=("cameras", "distortion", "image points", "control", "check points", "start values of points",
             "start orientations", "frame", "standard deviations"),
    estimates_cameras=True,
)  # fmt: skip
