"""What SOCET's point files are recognised by, and what they carry."""

from aatri.formats.parts.format import Format, begins
from aatri.formats.socet.reader import read_gpf, read_ipf

PAGE = "docs/formats.md#socet"


GPF = Format(
    "socet_gpf",
    "SOCET ground points (.gpf)",
    begins("GROUND POINT FILE"),
    "a first line GROUND POINT FILE",
    carries=("control", "start values of points", "standard deviations", "frame"),
    page=PAGE,
    read=read_gpf,
)
IPF = Format(
    "socet_ipf",
    "SOCET image points (.ipf)",
    begins("IMAGE POINT FILE"),
    "a first line IMAGE POINT FILE",
    carries=("image points", "standard deviations"),
    page=PAGE,
    read=read_ipf,
)
