"""Texts of small good files, for the samples that are damaged."""

from __future__ import annotations

import json

from tests.formats.inpho.test_inpho import project
from tests.formats.opf.made_project import files
from tests.formats.patb.test_patb import flight, records

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
_MMVII = """<?xml version="1.0" encoding="UTF-8" standalone="yes" ?>
<Root>
<Type>"MMVII_Serialization"</Type>
<Version>"0.0.0"</Version>
<Data>{}</Data>
</Root>
"""
MMVII_CAMERA = _MMVII.format("""<InternalCalibration>
<Name>"cam"</Name>
<PixelFrame><NbPix>4000 3000</NbPix></PixelFrame>
<Projection>"Stenope"</Projection>
<PerfectProj><F>2000.5</F><PP>2010 1490</PP></PerfectProj>
<Distorsion><Radial><K1>-0.05</K1></Radial></Distorsion>
</InternalCalibration>""")
MMVII_POSE = _MMVII.format("""<CameraPose>
<NameImage>"a.jpg"</NameImage>
<NameInternalCalib>"cam"</NameInternalCalib>
<Center>10 20 100.5</Center>
<RotMatrix><AxeI>1 0 0</AxeI><AxeJ>0 -1 0</AxeJ><AxeK>0 0 -1</AxeK></RotMatrix>
</CameraPose>
<SetMesIm><NameIm>"a.jpg"</NameIm><Measures>
<el><Name>"P1"</Name><Pt>700 300</Pt><Sigma2>1 0 1</Sigma2></el></Measures></SetMesIm>
""")
_SHOT = {"camera": "c", "rotation": [3.14, 0.0, 0.5], "translation": [1.0, 2.0, 3.0]}
RECONSTRUCTION = json.dumps(
    [
        {
            "cameras": {"c": {"projection_type": "perspective", "width": 4000, "height": 3000, "focal": 0.85}},
            "shots": {"a.jpg": _SHOT, "b.jpg": _SHOT},
            "points": {"1": {"coordinates": [1.5, 2.0, 3.0]}},
        }
    ],
    indent=1,
)
GROUND_CONTROL = json.dumps(
    {
        "points": [
            {
                "id": f"P{k}",
                "position": {"latitude": 47.25 + k, "longitude": 8.5, "altitude": 400.5},
                "observations": [{"shot_id": "a.jpg", "projection": [0.125, 0.25]}],
            }
            for k in range(2)
        ]
    },
    indent=1,
)
TRACKS = "OPENSFM_TRACKS_VERSION_v2\n" + "".join(
    f"{image}\t{k}\t{k}\t0.1{k}\t0.2\t0.001\t1\t2\t3\t-1\t-1\n" for image in ("a.jpg", "b.jpg") for k in range(3)
)
ORI, PRJ = records(*flight()), project()
OPF = files(with_tracks=False)
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
