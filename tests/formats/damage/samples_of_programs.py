"""Small good files of the formats of other programs, and where they are damaged."""

from __future__ import annotations

import json

from aatri.formats.parts.format import Reading
from tests.formats.bingo.test_bingo import GEOIN, IMAGES
from tests.formats.blocksexchange.test_blocksexchange import TEXT as BLOCKSEXCHANGE
from tests.formats.damage.good_sample import GoodSample
from tests.formats.navigation.test_navigation import MRK
from tests.formats.nvm.test_sparse_models import BUNDLER, NVM
from tests.formats.pix4d.test_pix4d import HEAD, IMAGE
from tests.formats.socet.test_socet import GPF, IPF

CALIBRATION = """<?xml version="1.0" ?>
<ExportAPERO>
<CalibrationInternConique>
<KnownConv>eConvApero_DistM2C</KnownConv>
<PP>500.0 400.0</PP>
<F>1000.0</F>
<SzIm>1000 800</SzIm>
<CalibDistortion><ModNoDist></ModNoDist></CalibDistortion>
</CalibrationInternConique>
</ExportAPERO>
"""
ORIENTATION = """<?xml version="1.0" ?>
<ExportAPERO>
<OrientationConique>
<TypeProj>eProjStenope</TypeProj>
<FileInterne>Ori-A/AutoCal-cam.xml</FileInterne>
<Externe><KnownConv>eConvApero_DistM2C</KnownConv>
<Centre>10.0 20.0 100.5</Centre>
<ParamRotation><CodageMatr><L1>1 0 0</L1><L2>0 -1 0</L2><L3>0 0 -1</L3></CodageMatr></ParamRotation></Externe>
<Verif><Tol>0.001</Tol><Appuis><Num>0</Num><Im>700 300</Im><Ter>12 21 90.5</Ter></Appuis></Verif>
</OrientationConique>
<MesureAppuiFlottant1Im><NameIm>a.jpg</NameIm>
<OneMesureAF1I><NamePt>P1</NamePt><PtIm>700 300</PtIm></OneMesureAF1I>
<OneMesureAF1I><NamePt>P2</NamePt><PtIm>710 300</PtIm></OneMesureAF1I></MesureAppuiFlottant1Im>
</ExportAPERO>
"""
_SHOT = {"camera": "c", "rotation": [3.14, 0.0, 0.5], "translation": [1.0, 2.0, 3.0]}
RECONSTRUCTION = json.dumps(
    [{"cameras": {"c": {"projection_type": "perspective", "width": 4000, "height": 3000, "focal": 0.85}},
      "shots": {"a.jpg": _SHOT, "b.jpg": _SHOT},
      "points": {"1": {"coordinates": [1.5, 2.0, 3.0]}}}],
    indent=1,
)  # fmt: skip
GROUND_CONTROL = json.dumps(
    {"points": [{"id": f"P{k}", "position": {"latitude": 47.25 + k, "longitude": 8.5, "altitude": 400.5},
                 "observations": [{"shot_id": "a.jpg", "projection": [0.125, 0.25]}]} for k in range(2)]},
    indent=1,
)  # fmt: skip
TRACKS = "OPENSFM_TRACKS_VERSION_v2\n" + "".join(
    f"{image}\t{k}\t{k}\t0.1{k}\t0.2\t0.001\t1\t2\t3\t-1\t-1\n" for image in ("a.jpg", "b.jpg") for k in range(3)
)
GCP_LIST = "EPSG:4326\n8.5 47.25 400.5 100.5 200 a.jpg P1\n8.6 47.25 401 300 200 a.jpg P2\n"
GEO = "EPSG:4326\na.jpg 8.5 47.25 490.5 10 0 0 0.02 0.03\nb.jpg 8.6 47.25 491 10 0 0 0.02 0.03\n"
APPLANIX = """POSPac exterior orientation
(position in Meters, orientation in Degrees, lat, long in Deg)
ID, EVENT, TIME(s), EASTING, NORTHING, ELLIPSOID HEIGHT, OMEGA, PHI, KAPPA, LAT, LONG
a1 1 200.5 500000.5 4000000.25 1200.0 0.5 -0.25 90.0 36.0 117.0
a2 2 201.5 500100.5 4000000.25 1201.0 0.5 -0.25 91.0 36.0 117.0
"""
TABLE = "image,X,Y,Z,omega,phi,kappa\na.jpg,100.5,200.25,300.5,0.5,1.5,2.5\nb.jpg,110.5,200.25,300.5,0.5,1.5,2.5\n"
OPK = (
    "NOM\tX\tY\tZ\tO\tP\tK\tCAMERA\na.tif\t800000.5\t6200000.25\t2800.5\t0.5\t-0.25\t90.5\tcam\n"
    "b.tif\t800500.5\t6200000.25\t2801\t0.5\t-0.25\t90.5\tcam\n"
)
NO_UNIT = "any number may stand here: only with the camera or control a unit can be wrong"
NO_SIZE = "the files do not say how large the images are"
PAIR = "the principal distance and pixels of the camera are in another file"

OF_PROGRAMS = {
    "bingo": GoodSample(
        {"image.dat": IMAGES},
        "image.dat",
        "1.5 [2.25]",
        "a.jpg",
        ("-0.5 1.0", "-0.5 1.0 0 M 2"),
        ("        -99\n        b.jpg", "        b.jpg"),
        ("b.jpg", "a.jpg"),
        PAIR,
    ),
    "bingo_geoin": GoodSample(
        {"geoin.dat": GEOIN},
        "geoin.dat",
        "5 [10.0] 20.0",
        "CONT               1",
        ("COES                0.0050000000000000.0050000000000000.015000000000000", "COES   0.01"),
        ("CAPA   FC300X_(3.61_mm)3.610000000000000\n", ""),
        ("   5 10.0", "  41 10.0"),
        PAIR,
    ),
    "blocksexchange": GoodSample(
        {"block.xml": BLOCKSEXCHANGE},
        "block.xml",
        "<K1>[0.1]",
        "<Name>cam",
        ('"2.1"', '"1.0"'),
        ("<SensorSize>20</SensorSize>", ""),
        ("<Id>1<", "<Id>0<"),
        ("<SensorSize>20</SensorSize>", "<SensorSize>20000</SensorSize>"),
    ),
    "dji_mrk": GoodSample(
        {"t_Timestamp.MRK": MRK},
        "t_Timestamp.MRK",
        "[31.5],Lat",
        "2",
        ("Ellh", "Alt"),
        ("31.5,Lat\t", ""),
        ("1\t99", "2\t99"),
        ("31.5,Lat", "3486000.5,Lat"),
    ),
    "applanix": GoodSample(
        {"eo.txt": APPLANIX},
        "eo.txt",
        "[1201.0]",
        "a1",
        ("OMEGA, PHI", "OMEGA, ROLL"),
        ("ID, EVENT, TIME(s), EASTING, NORTHING, ELLIPSOID HEIGHT, OMEGA, PHI, KAPPA, LAT, LONG\n", ""),
        ("a2", "a1"),
        ("Meters", "Feet"),
    ),
    "nvm": GoodSample(
        {"m.nvm": NVM},
        "m.nvm",
        "0 [0.1] 0",
        "a.jpg",
        ("NVM_V3", "NVM_V2"),
        ("\n5\n", "\n"),
        ("b.jpg", "a.jpg"),
        NO_SIZE,
    ),
    "bundler": GoodSample(
        {"bundle.out": BUNDLER, "list.txt": "left.jpg\nright.jpg\n"},
        "bundle.out",
        "1000 [-0.05] 0.01",
        "Bundle",
        ("v0.3", "v0.4"),
        ("2 1\n", ""),
        "images and points are counted",
        NO_SIZE,
    ),
    "pix4d": GoodSample(
        {
            "t_calibrated_camera_parameters.txt": HEAD + IMAGE.format("a.jpg") + IMAGE.format("b.jpg"),
            "t_offset.xyz": "1000.0 2000.0 100.0",
        },
        "t_calibrated_camera_parameters.txt",
        "[0.1] 0.02",
        "a.jpg",
        ("fileName", "name"),
        ("0.001 0.002\n", ""),
        ("b.jpg", "a.jpg"),
        ("2000 0 2010", "8.8 0 6"),
        path="",
    ),
    "ign_opk": GoodSample(
        {"l.OPK": OPK},
        "l.OPK",
        "\t[6200000.25]\t2801",
        "b.tif",
        ("b.tif\t800500.5", "b.tif\t12:00:01\t7\t800500.5"),
        ("\t0.5\t-0.25\t90.5\tcam\nb", "\nb"),
        ("b.tif", "a.tif"),
        ("\t90.5\tcam\nb", "\t9050.5\tcam\nb"),
    ),
    "ign_camera": GoodSample(
        {"cam.txt": "Name = UCE\nPPAx = 13210.5\nPPAy = 8502.0\nfocal = 30975.0\nwidth = 26460\nheight = 17004\n"},
        "cam.txt",
        "[13210.5]",
        "UCE",
        ("focal =", "f ="),
        ("focal = 30975.0\n", ""),
        ("PPAy", "PPAx"),
        ("30975.0", "120.0"),
    ),
    "ign_app": GoodSample(
        {"g.app": '"1003" 13 815601.5 6283629.25 54.96\n"1005" 3 833670.94 6281965.5 52.63\n'},
        "g.app",
        "[6281965.5] ",
        "1005",
        ('"1005" 3', '"1005" 3 7'),
        (" 52.63", ""),
        ("1005", "1003"),
        NO_UNIT,
    ),
    "ign_mes": GoodSample(
        {"m.mes": '"1003" IMG_1306 24042.25 14781.17\n"1003" IMG_1307 24120.2 10329.3\n'},
        "m.mes",
        "[24120.2]",
        "IMG_1307",
        ("10329.3", "10329.3 0 0"),
        (" 10329.3", ""),
        ("IMG_1307", "IMG_1306"),
        PAIR,
    ),
    "micmac": GoodSample(
        {"Orientation-a.jpg.xml": ORIENTATION, "AutoCal-cam.xml": CALIBRATION},
        "Orientation-a.jpg.xml",
        "<Centre>10.0 20.0 [100.5]",
        "P2",
        ("<KnownConv>eConvApero_DistM2C", "<KnownConv>eConvOriLib"),
        ("<L2>0 -1 0</L2>", ""),
        ("<NamePt>P2", "<NamePt>P1"),
        ("10.0 20.0 100.5", "10000.0 20000.0 100500"),
        path="",
    ),
    "table": GoodSample(
        {"list.csv": TABLE},
        "list.csv",
        "b.jpg,[110.5]",
        "b.jpg",
        ("omega,phi", "omega,psi"),
        (",2.5\n", "\n"),
        ("b.jpg", "a.jpg"),
        ("1.5,2.5\nb", "1.5,6000.5\nb"),
    ),
    "opensfm": GoodSample(
        {"reconstruction.json": RECONSTRUCTION},
        "reconstruction.json",
        "[0.85]",
        "a.jpg",
        ('"perspective"', '"fisheye624"'),
        ('"shots"', '"x"'),
        ("b.jpg", "a.jpg"),
        ("0.85", "3400.0"),
    ),
    "opensfm_tracks": GoodSample(
        {"tracks.csv": TRACKS},
        "tracks.csv",
        "0\t0\t[0.10]",
        "b.jpg",
        ("_v2", "_v7"),
        ("\t0.001\t", "\t"),
        ("a.jpg\t1\t1", "a.jpg\t0\t0"),
        ("0.10", "2100.5"),
    ),
    "opensfm_gcp": GoodSample(
        {"ground_control_points.json": GROUND_CONTROL},
        "ground_control_points.json",
        '"latitude": [47.25]',
        "a.jpg",
        ('"projection"', '"position_px"'),
        ('"points"', '"x"'),
        ("P1", "P0"),
        ("47.25", "5200000.5"),
    ),
    "odm_gcp": GoodSample(
        {"gcp_list.txt": GCP_LIST},
        "gcp_list.txt",
        "400.5 [100.5]",
        "P2",
        ("EPSG:4326", "PUWG1992"),
        ("EPSG:4326\n", ""),
        ("300 200 a.jpg P2", "300 200 a.jpg P1"),
        ("8.6 47.25", "500000 5200000"),
    ),
    "odm_geo": GoodSample(
        {"geo.txt": GEO},
        "geo.txt",
        "a.jpg 8.5 [47.25]",
        "b.jpg",
        ("EPSG:4326", "PUWG1992"),
        ("EPSG:4326\n", ""),
        ("b.jpg", "a.jpg"),
        ("8.6 47.25", "500000 5200000"),
    ),
    "socet_gpf": GoodSample(
        {"p.gpf": GPF},
        "p.gpf",
        "[0.086]",
        "B 1",
        ("GROUND POINT FILE", "GROUND POINT FILE 2"),
        ("1 2 3\n\nB", "\nB"),
        ("B 1 0", "A 1 0"),
        ("0.086", "49.27"),
        reading=Reading(crs="EPSG:4979"),
    ),
    "socet_ipf": GoodSample(
        {"i.ipf": IPF},
        "i.ipf",
        "[-4058.5]",
        "B 0",
        ("IMAGE POINT FILE", "IMAGE POINT FILE 2"),
        ("0 0\n0 0\n\nB", "\nB"),
        ("B 0 0 0", "A 0 0 0"),
        PAIR,
    ),
}
