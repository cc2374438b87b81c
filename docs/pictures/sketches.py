"""Sketches of the method pages: what a method has and what it makes, as pictures of the report."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from strokes import GROUND, area, dots, ground_at, line, rectangle, segments, words

from aatri.report.drawing.picture import Marks, Picture

MADE: dict[str, Callable[[], Picture]] = {}
"""Functions that draw, by the name of their file."""


def sketch(title: str) -> Callable[[Callable[[], list[Marks]]], None]:
    """A function that gives marks makes the picture of its name; x to the right, y or height upwards."""

    def register(draw: Callable[[], list[Marks]]) -> None:
        MADE[draw.__name__] = lambda: Picture(draw.__name__, title, "", draw(), ground=False)

    return register


@sketch("From what the instrument reads to the axes of the photo")
def interior_orientation() -> list[Marks]:
    marks = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]], float)
    turn = np.array([[0.985, -0.174], [0.174, 0.985]])
    read = marks @ turn.T * (1.02, 0.97) + (3.2, 0.1)
    point, on_photo = np.array([3.6, 0.55]), np.array([0.45, 0.36])
    return [
        rectangle("soft", 3.2, 0.1, 2.4, 2.3, turn_deg=10),
        rectangle("soft", 0, 0, 2.3, 2.3),
        line("soft", (1.75, -1.3), (4.7, -1.3)),
        line("soft", (1.75, -1.3), (1.75, 1.4)),
        line("blue", (-1, 0), (1.0, 0)),
        line("blue", (0, -1), (0, 1.0)),
        dots("red", read, [f"{k + 1}" for k in range(4)], "fiducial marks, read", shape="crosses"),
        dots("green", marks, [f"{k + 1}" for k in range(4)], "calibrated", shape="crosses"),
        dots("ink", [point, on_photo], ["P", "P"], "image point"),
        words((0.1, 0.9, "y"), (0.9, 0.08, "x"), (4.6, -1.25, "comparator")),
    ]


@sketch("Two images, one base, rays that must meet")
def relative_orientation() -> list[Marks]:
    left, right = np.array([0.0, 2.0]), np.array([2.0, 2.1])
    points = np.array([ground_at(x) for x in (0.1, 0.7, 1.3, 1.9)])
    off = np.array([1.05, -0.55])
    return [
        line("soft", *GROUND.tolist()),
        line("blue", left.tolist(), right.tolist(), name="base", width=2.0),
        segments("amber", left, points, "rays"),
        segments("amber", right, points),
        segments("red", [left, right], [[1.0, -0.5], [1.12, -0.5]], "rays that miss each other: parallax", dashed=True),
        dots("ink", points, name="model points"),
        dots("blue", [left, right], ["left", "right"], "projection centres", width=8.0),
        dots("red", off, width=1.0),
    ]


@sketch("Models follow one another: rotation and centre of the common image, scale of common points")
def strip_formation() -> list[Marks]:
    made: list[Marks] = []
    for k, colour in enumerate(("blue", "green", "violet")):
        scale, x = (1.0, 0.86, 1.13)[k], 1.5 * k
        made += [
            area(
                colour,
                (x, 2.0),
                (x + 1.5 * scale, 2.0 - 0.1 * k),
                (x + 1.5 * scale, 2 - 1.6 * scale),
                (x, 2 - 1.6 * scale),
                name=f"model {k + 1}",
                fill=0.08,
            ),
            dots(colour, [[x + 0.15, 2 - 1.45 * scale], [x + 1.35 * scale, 2 - 1.45 * scale]]),
        ]
    ends = np.array([[1.5, 2.0], [3.0, 2.0]])
    return [*made, dots("red", ends, ["common image"] * 2, "common projection centres", width=9.0)]


@sketch("A free strip goes to the ground by shift, turn and scale")
def absolute_orientation() -> list[Marks]:
    free = np.array([[0, 0], [0.5, 0.02], [1, 0.03], [1.5, 0.02], [2, 0.0]])
    turn = 1.35 * np.array([[0.94, -0.34], [0.34, 0.94]])
    control = np.array([[0, -0.4], [2, -0.4], [2, 0.4], [0, 0.4]])
    on_ground = free @ turn.T + (3.0, 0.1)
    targets = control @ turn.T + (3.0, 0.1)
    return [
        line("blue", *free.tolist(), name="projection centres"),
        dots("blue", free),
        line("blue", *on_ground.tolist()),
        dots("blue", on_ground),
        dots("soft", control, name="control, in the model", shape="circles"),
        dots("red", targets, ["GCP1", "GCP2", "GCP3", "GCP4"], "control, on the ground", shape="triangles"),
        segments("soft", control, targets, dashed=True),
        words((0.3, 0.65, "strip in its own frame"), (4.1, -0.6, "on the ground")),
    ]


@sketch("Resection: the image from known points. Intersection: a point from known images")
def partial_bundles() -> list[Marks]:
    left = np.array([0.4, 2.0])
    known = np.array([ground_at(x) for x in (-0.4, 0.2, 0.8, 1.1)])
    images, point = np.array([[2.6, 2.0], [3.4, 2.1], [4.2, 1.95]]), np.array([3.5, 0.1])
    return [
        line("soft", *GROUND.tolist()),
        line("soft", (3.2, 0.05), (4.9, 0.1)),
        segments("amber", left, known, "rays"),
        segments("amber", point, images),
        dots("red", known, name="known points", shape="triangles"),
        dots("blue", left, ["unknown image"], width=8.0, name="unknown"),
        dots("red", images, name="known images", width=8.0),
        dots("blue", point, ["unknown point"], width=8.0),
    ]


@sketch("Every model is a rigid body: shift, turn and scale until what they share agrees")
def independent_models() -> list[Marks]:
    places = [(0, 0, 4), (1.55, 0.15, -6), (3.1, -0.1, 3), (0.1, 1.6, -4), (1.6, 1.65, 5), (3.15, 1.55, -3)]
    models = [
        rectangle("blue", x, y, 1.7, 1.7, turn_deg=turn, name="models" if k == 0 else "")
        for k, (x, y, turn) in enumerate(places)
    ]
    ties = np.array(
        [[0.75, -0.6], [0.8, 0.75], [2.3, -0.6], [2.35, 0.8], [0.85, 2.3], [2.4, 2.3], [-0.6, 0.8], [3.8, 0.75]]
    )
    apart = ties + np.array(
        [[0.12, 0.06], [-0.1, 0.09], [0.1, -0.1], [-0.1, 0.1], [0.1, 0.06], [-0.12, -0.05], [0.1, 0.1], [-0.1, 0.08]]
    )
    return [
        *models,
        segments("red", ties, apart, "disagreement at shared points", width=2.0),
        dots("ink", ties),
        dots("ink", apart),
        dots("red", [[-0.7, -0.7], [3.9, -0.75], [3.9, 2.3], [-0.7, 2.35]], name="control", shape="triangles"),
    ]


@sketch("A strip bends as errors add up; a polynomial in its own axes takes the bend off")
def strip_block_adjustment() -> list[Marks]:
    x = np.linspace(0, 4, 60)
    bent = np.stack([x, 0.5 + 0.12 * x**2 - 0.008 * x**3], 1)
    models = np.linspace(0, 4, 9)
    control = np.array([[0.1, 0.5], [2.0, 0.5], [3.9, 0.5]])
    return [
        line("red", *bent.tolist(), name="strip after strip formation"),
        line("green", (0, 0.5), (4, 0.5), name="after the adjustment", width=2.0),
        dots("red", np.stack([models, np.interp(models, x, bent[:, 1])], 1)),
        dots("green", np.stack([models, 0 * models + 0.5], 1)),
        segments(
            "soft",
            np.stack([models, np.interp(models, x, bent[:, 1])], 1),
            np.stack([models, 0 * models + 0.5], 1),
            dashed=True,
        ),
        dots("red", control, ["control", "control", "control"], shape="triangles"),
        dots("ink", [[0, -0.1]], width=0.1),
    ]


@sketch("Camera, antenna and IMU: lever arm, boresight, and what they are observed by")
def gnss_imu() -> list[Marks]:
    centre, antenna = np.array([0.0, 0.0]), np.array([-0.7, 0.9])
    return [
        area("soft", (-1.8, 0.35), (1.6, 0.35), (1.9, 0.6), (1.5, 0.85), (-1.8, 0.85), fill=0.08),
        segments("red", [centre], [antenna], "lever arm (block.yaml: antenna)", width=2.0),
        segments("blue", [centre, centre], [[0, -1.3], [0.75, 0]], "axes of the camera", width=1.6),
        segments(
            "green",
            [[0.02, 0.01]] * 2,
            [[0.16, -1.28], [0.74, 0.1]],
            "axes of the IMU: turned by the boresight",
            dashed=True,
        ),
        dots("blue", centre, ["projection centre"], width=8.0),
        dots("red", antenna, ["antenna: observed position"], shape="triangles"),
    ]


@sketch("Conditions between points: distances, planes, lines, angles")
def relative_control() -> list[Marks]:
    return [
        segments("red", [[0, 0]], [[1.6, 0.25]], "distance", width=2.0),
        dots("ink", [[0, 0], [1.6, 0.25]], ["A", "B"]),
        area("green", (2.4, -0.2), (3.6, 0.1), (3.6, 1.2), (2.4, 0.9), name="plane"),
        dots("ink", [[2.6, 0.1], [3.4, 0.2], [3.4, 1.0], [2.6, 0.8]], ["11", "12", "13", "14"]),
        line("blue", (0.1, 1.0), (2.0, 1.45), name="line"),
        dots("ink", [[0.2, 1.02], [0.8, 1.17], [1.9, 1.42]], ["L1", "L2", "L3"]),
        segments("amber", [[4.4, 0]] * 2, [[5.3, 0], [4.4, 0.9]], "angle"),
        dots("ink", [[4.4, 0], [5.3, 0], [4.4, 0.9]], ["P", "Q", "R"]),
    ]


@sketch("Two blocks that share a strip are one block")
def merging() -> list[Marks]:
    def feet(colour: str, rows: Sequence[float], name: str) -> list[Marks]:
        return [
            rectangle(colour, 0.5 * k, y, 1.1, 1.1, name if (k, y) == (0, rows[0]) else "")
            for y in rows
            for k in range(6)
        ]

    at = np.array([[0.5 * k, 1.5 + 0.3 * (k % 3 - 1)] for k in range(6)])
    return [
        *feet("blue", [0, 0.75], "images of the first block"),
        *feet("violet", [2.25, 3.0], "images of the second"),
        *feet("amber", [1.5], "images of both"),
        dots("ink", at, name="shared points"),
    ]


@sketch("The same place found in several images is a tie point")
def tie_points() -> list[Marks]:
    x, y = np.random.default_rng(1).uniform((0.62, -0.7), (0.98, 0.7), (14, 2)).T
    left, right = np.stack([x, y], 1), np.stack([x + 1.72, y + 0.06], 1)
    alone = np.array([[-0.5, 0.5], [0.1, -0.4], [-0.2, 0.0], [0.3, 0.7], [3.2, 0.1], [3.5, -0.5], [2.9, 0.6]])
    return [
        rectangle("soft", 0, 0, 2.1, 1.6),
        rectangle("soft", 2.7, 0, 2.1, 1.6),
        segments("green", left, right, "matches that fit one relative orientation"),
        segments("red", [left[0]], [right[5]], "a wrong match: its rays do not meet", dashed=True),
        dots("blue", np.concatenate([left, right]), name="places found in both"),
        dots("soft", alone, name="found in one only"),
    ]


@sketch("A mark, its model, and where it fits")
def fiducial_marks() -> list[Marks]:
    turn = np.radians(5)
    c, s = np.cos(turn), np.sin(turn)
    arms = np.array([[[-1, 0], [1, 0]], [[0, -1], [0, 1]]]) @ np.array([[c, s], [-s, c]]) + (0.1, -0.05)
    noise = np.random.default_rng(2).uniform(-1.5, 1.5, (400, 2))
    return [
        rectangle("soft", 0, 0, 3.1, 3.1),
        dots("soft", noise, width=2.0, name="noise of the scan"),
        Marks("segments", arms, "ink", "mark in the scan", width=9.0),
        Marks("segments", arms, "green", "model, where it correlates best", width=1.5),
        dots("red", [[0.1, -0.05]], ["centre, to a fraction of a pixel"], shape="crosses"),
    ]


@sketch("What a row of edits does: the tables stay, the block is read with the edits")
def editing() -> list[Marks]:
    points = np.array([[0.4, 0.5], [1.5, 1.1]])
    return [
        rectangle("soft", 1.0, 0.8, 2.6, 2.0, "image 0203"),
        dots(
            "red",
            points,
            ["measured as 155, is 101", "measured as 101, is 155"],
            "image points whose numbers are exchanged",
            shape="crosses",
        ),
        segments("red", [points[0]], [points[1]], dashed=True),
        rectangle("soft", 4.0, 0.8, 2.6, 2.0),
        dots("green", points + np.array([3.0, 0.0]), ["101", "155"], "after the edit"),
        segments("blue", [[2.35, 0.8]], [[2.65, 0.8]], width=2.5),
    ]


@sketch("Positions of the receiver are off by a shift and a drift of each strip")
def observed_positions() -> list[Marks]:
    t = np.linspace(0, 4, 9)
    made = []
    for k, (y, shift, drift) in enumerate([(0.0, 0.28, 0.02), (1.2, -0.2, 0.06)]):
        flown = np.stack([t, np.full(9, y)], 1)
        observed = flown + np.stack([0 * t, shift + drift * t + 0.02 * np.sin(7 * t + k)], 1)
        made += [
            line("blue", *flown.tolist()),
            dots("blue", flown, name="" if k else "projection centres"),
            dots("red", observed, name="" if k else "observed positions", shape="crosses"),
            line(
                "red",
                *np.stack([t, y + shift + drift * t], 1).tolist(),
                name="" if k else "shift s and drift d, unknowns",
                dashed=True,
            ),
        ]
    return made


@sketch("Convergent images around an object, a scale bar in it")
def close_range() -> list[Marks]:
    turn = np.radians(np.arange(0, 360, 45))
    stations = 2.0 * np.stack([np.cos(turn), np.sin(turn)], 1)
    targets = np.array([[-0.6, -0.4], [0.6, -0.45], [0.65, 0.4], [-0.55, 0.45], [0.0, 0.1]])
    rays = [(s, t) for s in stations for t in targets]
    return [
        rectangle("soft", 0, 0, 1.8, 1.3, "object"),
        segments("amber", [a for a, _ in rays], [b for _, b in rays], "rays", width=0.5),
        segments("green", [[-0.7, -0.58]], [[0.7, -0.58]], "scale bar", width=2.5),
        dots("red", targets, name="targets", shape="circles"),
        dots("blue", stations, name="camera stations", width=8.0),
    ]
