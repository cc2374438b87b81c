"""The formats, in the order in which a file is held against them: what is told apart more surely comes first.

A new format is a `Format` in its own room, and a line here.
"""

from collections.abc import Mapping

from aatri.formats.bingo.reader import BINGO, GEOIN
from aatri.formats.blocksexchange.reader import BLOCKSEXCHANGE
from aatri.formats.gis.geojson import GEOJSON
from aatri.formats.gis.geopackage import GEOPACKAGE
from aatri.formats.ign.reader import IGN_CAMERA, IGN_MARKS, IGN_POINTS
from aatri.formats.inpho.reader import INPHO
from aatri.formats.lists.declaration import APPLANIX, IGN_OPK, TABLE
from aatri.formats.metashape.reader import METASHAPE
from aatri.formats.micmac.reader import MICMAC
from aatri.formats.navigation.mrk import MRK
from aatri.formats.navigation.photo_folder import PHOTOS
from aatri.formats.navigation.xmp import XMP
from aatri.formats.nvm.bundler_reader import BUNDLER
from aatri.formats.nvm.nvm_model import NVM
from aatri.formats.opensfm.declaration import GCP_LIST, GEO, GROUND_CONTROL, RECONSTRUCTION, TRACKS
from aatri.formats.opf.reader import OPF
from aatri.formats.parts.format import Format
from aatri.formats.patb.orientations import PATB
from aatri.formats.pix4d.reader import PIX4D
from aatri.formats.registry.own_stages import BAL, COLMAP, DBAT, DBAT_CONTROL, GAMA, PAIRS, TABLES, WUCAPS
from aatri.formats.socet.reader import GPF, IPF

FORMATS: tuple[Format, ...] = (
    TABLES,
    COLMAP,
    RECONSTRUCTION,
    TRACKS,
    GROUND_CONTROL,
    OPF,
    GAMA,
    METASHAPE,
    MICMAC,
    MRK,
    PHOTOS,
    XMP,
    APPLANIX,
    BLOCKSEXCHANGE,
    NVM,
    BUNDLER,
    PIX4D,
    INPHO,
    PATB,
    GPF,
    IPF,
    GEOIN,
    IGN_OPK,
    IGN_CAMERA,
    IGN_POINTS,
    BINGO,
    DBAT_CONTROL,
    TABLE,
    GCP_LIST,
    GEO,
    IGN_MARKS,
    WUCAPS,
    DBAT,
    PAIRS,
    BAL,
    GEOPACKAGE,
    GEOJSON,
)
"""All formats."""

BY_NAME: Mapping[str, Format] = {name: f for f in FORMATS for name in (*f.other_names, f.name)}
"""The formats by their names, the usual one and others."""
