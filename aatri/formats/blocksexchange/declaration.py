"""What BlocksExchange XML is recognised by, and what it carries."""

from aatri.formats.blocksexchange.reader import read_blocksexchange
from aatri.formats.blocksexchange.writer import write_blocksexchange
from aatri.formats.parts.format import Format

BLOCKSEXCHANGE = Format(
    "blocksexchange", "BlocksExchange XML", lambda view: "<BlocksExchange" in view.head, "XML with `BlocksExchange`",
    carries=("cameras", "distortion", "image points", "control", "check points", "start values of points",
             "start orientations", "frame", "standard deviations"),
    page="docs/formats.md#blocksexchange", read=read_blocksexchange, write=write_blocksexchange,
    written=("cameras", "distortion", "image points", "control", "check points", "start values of points",
             "start orientations", "frame", "standard deviations"),
    estimates_cameras=True,
)  # fmt: skip
