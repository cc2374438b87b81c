"""Small good files of the formats of other programs, and where they are damaged."""

from __future__ import annotations

from tests.formats.blocksexchange.test_blocksexchange import TEXT as BLOCKSEXCHANGE
from tests.formats.damage.good_sample import GoodSample
from tests.formats.damage.texts import (
    CALIBRATION,
    GROUND_CONTROL,
    MMVII_CAMERA,
    MMVII_POSE,
    OPF,
    ORIENTATION,
    PRJ,
    RECONSTRUCTION,
    TRACKS,
)
from tests.formats.metashape.test_metashape import OLD
from tests.formats.metashape.test_metashape import local as local_chunk
from tests.formats.nvm.test_sparse_models import BUNDLER, NVM
from tests.formats.opf.made_project import NAMES
from tests.formats.pix4d.test_pix4d import HEAD, IMAGE

NO_SIZE = "the files do not say how large the images are"

OF_PROGRAMS = {
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
    "metashape": GoodSample(
        {"cameras.xml": local_chunk()},
        "cameras.xml",
        'x="[2200.5]"',
        "b.jpg",
        ('type="frame" class="adjusted"', 'type="fisheye" class="adjusted"'),
        ('<camera id="7"', "<camera"),
        ('label="P2"', 'label="P1"'),
        ('sxyz="0.5"', 'sxyz="-0.5"'),
    ),
    "inpho": GoodSample(
        {"block.prj": PRJ},
        "block.prj",
        "[100.5] 5",
        "P1",
        ("$EXT_ORI : 12:00:00 01/01/2026\n", "$EXT_ORI : 12:00:00 01/01/2026\n 1 2 3\n"),
        ("    $FOCAL_LENGTH : 100.5\n", ""),
        ("$PHOTO_NUM : 2\n", "$PHOTO_NUM : 1\n"),
        ("OBJECT : m", "OBJECT : ft"),
    ),
    "opf": GoodSample(
        OPF,
        "calibrated-cameras.json",
        '"focal_length_px": [2000.5]',
        "perspective",
        ('"version": "1.0"', '"version": "2.0"'),
        ('"principal_point_px"', '"x"'),
        (f'"id": {next(iter(NAMES))}', '"id": 7'),
        ("2000.5", "8.8"),
        path="",
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
}

OLD_CHUNK = local_chunk(OLD, "0.9.1").replace(
    "<transform><rotation>1 0 0 0 1 0 0 0 1</rotation><translation>1 2 3</translation><scale>2</scale></transform>",
    "<transform>2 0 0 1.5 0 2 0 2 0 0 2 3 0 0 0 1</transform>",
)
LENS = """<?xml version="1.0"?>
<calibration>
<projection>frame</projection>
<width>4000</width><height>3000</height>
<f>3000.5</f>
<cx>10</cx><cy>-20</cy>
</calibration>
"""

OF_VARIANTS = {
    "metashape/psz": GoodSample(
        {"p.psz": local_chunk()},
        "p.psz",
        'x="[2200.5]"',
        "b.jpg",
        ('type="frame" class="adjusted"', 'type="fisheye" class="adjusted"'),
        ('<camera id="7"', "<camera"),
        ('label="P2"', 'label="P1"'),
        ('sxyz="0.5"', 'sxyz="-0.5"'),
        packed=True,
    ),
    "metashape/old": GoodSample(
        {"cameras.xml": OLD_CHUNK},
        "cameras.xml",
        "0 0 [1.5] 0 2",
        "b.jpg",
        ("<skew>0</skew>", "<skew>0</skew><p3>0.1</p3>"),
        ("<fy>3000</fy>", ""),
        ('id="8" sensor_id="1"', 'id="7" sensor_id="1"'),
        ("<fx>3003</fx><fy>3000</fy>", "<fx>12.0</fx><fy>12.0</fy>"),
    ),
    "metashape/calibration": GoodSample(
        {"lens.xml": LENS},
        "lens.xml",
        "<f>[3000.5]</f>",
        "frame",
        ("<projection>frame", "<projection>fisheye"),
        ("<f>3000.5</f>\n", ""),
        ("<cx>", "<cx>11</cx><cx>"),
        ("3000.5", "-12.0"),
    ),
    "micmac/mmvii": GoodSample(
        {"Calib-cam.xml": MMVII_CAMERA, "Ori-a.jpg.xml": MMVII_POSE},
        "Calib-cam.xml",
        "<F>[2000.5]</F>",
        "cam",
        ("MMVII_Serialization", "MMVII_Binary"),
        ("<PixelFrame><NbPix>4000 3000</NbPix></PixelFrame>\n", ""),
        ("<F>2000.5</F>", "<F>2000.5</F><F>2000.5</F>"),
        ("<F>2000.5</F>", "<F>-8.5</F>"),
        path="",
    ),
}
"""Further forms of a format, by its name and what they are: the same damages."""
