"""Small good files of the formats that have a stage of their own, and where they are damaged."""

from __future__ import annotations

from tests.campaigns.fuzz_seeds import BAL, DBAT, GAMA, PAIRS, WUCAPS
from tests.formats.damage.good_sample import GoodSample
from tests.formats.tables.block_folder import FILES

COLMAP = {
    "cameras.txt": "1 SIMPLE_PINHOLE 1000 800 900.5 500 400\n",
    "images.txt": "".join(
        f"{i} 1 0 0 0 {-i}.5 0 0 1 {i}.jpg\n" + " ".join(f"{500 + 90 * k - 30 * i}.5 400.25 {k}" for k in (1, 2)) + "\n"
        for i in (1, 2)
    ),
    "points3D.txt": "".join(f"{k} {k}.5 0 5.25 0 0 0 0.5 1 {k - 1} 2 {k - 1}\n" for k in (1, 2)),
}

OF_OWN_STAGES = {
    "tables": GoodSample(
        FILES,
        "block.yaml",
        "principal_distance: [153.84]",
        "name: bit",
        ("aatri_block: 1", "aatri_block: 2"),
        ("rotation: phi-omega-kappa\n", ""),
        ("\n  uav:", "\n  007:"),
        ("ground: m", "ground: ft"),
        path="",
    ),
    "colmap": GoodSample(
        COLMAP,
        "images.txt",
        "[-1.5] 0 0",
        "1.jpg",
        (" 1.jpg", ""),
        ("1 1 0 0 0 -1.5 0 0 1 1.jpg\n", ""),
        ("2.jpg", "1.jpg"),
        "lengths have no unit in a free model",
        path="",
    ),
    "dbat": GoodSample(
        {"export.txt": DBAT + "2 1003 900.5 586.25 0.1 0.1\n"},
        "export.txt",
        "0.1 [1.794] 1.468",
        "P1.JPG",
        ("0.0005 20 2272 1704", "0.0005 20 2272"),
        (" 1 0 0 0 0 0 0\n", ""),
        ("images\\P1.JPG", "images\\P0.JPG"),
        "millimetres and degrees by definition: nothing else is there to compare with",
    ),
    "dbat_control": GoodSample(
        {
            "control.txt": "# Id, Name, X, Y, Z\n317, B2.16, 999604.580, 112344.443, 139.453\n"
            "375, B3.05, 1, 2, 3, 0.02\n"
        },
        "control.txt",
        "[112344.443], 139",
        "B2.16",
        ("139.453", "139.453, 0.1, 0.2, 0.3, 7"),
        (", 139.453", ""),
        ("375,", "317,"),
        "metres by definition: nothing else is there to compare with",
    ),
    "wucaps": GoodSample(
        WUCAPS,
        "PRECKI.DAT",
        "831000 [4505078.925]",
        "831000",
        ("831000 4505078.925", "831000 7 4505078.925"),
        ("831000 4505078.925 446018.619 7.841\n", ""),
        ("832000", "831000"),
        "metres by definition: nothing else is there to compare with",
        path="",
    ),
    "bal": GoodSample(
        {"p.txt": BAL},
        "p.txt",
        "0 1 [50.5]",
        "2 3 5",
        ("3 4 12", "3 4 13"),
        ("2 3 56.5 36.25\n", ""),
        "images and points are counted; an image point twice is screened",
        "lengths have no unit in a free model",
    ),
    "pairs": GoodSample(
        PAIRS,
        "1-2.dat",
        "[20.5] -30",
        "3 40.5",
        ("153.84 0.011 0.002", "153.84 0.011"),
        ("153.84 0.011 0.002\n", ""),
        ("1 20.5", "0 20.5"),
        ("153.84 ", "0.15384 "),
        path="",
    ),
    "gama": GoodSample(
        {"n.gkf": GAMA},
        "n.gkf",
        'x="[1000.5]"',
        'id="A',
        ("<gama-local", "<gama-xml"),
        (' y="5000.25"', ""),
        ('id="B"', 'id="A"'),
        ('angles="left-handed"', 'angles="left-handed" units="feet"'),
    ),
}
