"""Units of the parameters in a Solution, for headers and reports.

Of a camera's own model those of `brown`, the one with an affinity `as`, are of mm; the others are of normalised
coordinates (docs/formats.md).
"""

from aatri.artifacts.solution import Solution
from aatri.camera.parameters.brown import BROWN_CONRADY
from aatri.camera.parameters.catalogue import SETS, parameter_set
from aatri.camera.parameters.parameter_set import ParameterSet
from aatri.observations.poses import CAMERA

_BY_NAME = {
    **dict.fromkeys(("principal_distance", "principal_point.x", "principal_point.y", "c", "x0", "y0"), "mm"),
    **dict.fromkeys(("film correction d0", "film correction d3"), "mm"),
    **dict.fromkeys((f"film correction d{k}" for k in (1, 2, 4, 5)), "1"),
    **dict.fromkeys(("film correction d6", "film correction d7"), "1/mm"),
    **dict.fromkeys(("lever x", "lever y", "lever z", "shift X", "shift Y", "shift Z"), "m"),
    **dict.fromkeys(("drift X", "drift Y", "drift Z"), "m/s (m/image without times)"),
    **dict.fromkeys(("vx", "vy", "vz"), "m/s"),
    **dict.fromkeys([f"{turn} {k}" for turn in ("tilt", "turn") for k in (1, 2)] + ["tilt", "turn"], "m/m"),
    **dict.fromkeys([f"{place} {k}" for place in ("offset", "centre") for k in (1, 2, 3)], "m"),
    **dict.fromkeys(("offset", "east", "north", "height", "radius", "addition"), "m"),
    "scale": "1",
    "readout": "of row_time",
    "time offset": "s",
    "tau_m": "m",
    "orientation": "rad",
    **{f"boresight {axis}": "rad" for axis in "xyz"},
    **{f"mount {axis}": "m" for axis in "XYZ"},
    **{f"mount turn about {axis}": "rad" for axis in "xyz"},
    **{f"shift {angle}": "rad" for angle in ("omega", "phi", "kappa", "roll", "pitch", "heading")},
}

NORMALISED = "1 (normalised)"
_OF_BROWN = dict(zip(BROWN_CONRADY.parameters, BROWN_CONRADY.units))


def parameter_units(solution: Solution) -> list[str]:
    """Unit of each row of the parameters; empty where it depends on what the Solution does not tell."""
    units = dict(_BY_NAME)
    sets = solution.calibrated_sets
    for name in set() if sets is None else set(sets.set.tolist()):
        units |= _units_of_set(str(name), solution)
    p = solution.parameters
    own, in_mm = p.group == CAMERA, set(p.object[(p.group == CAMERA) & (p.name == "as")].tolist())
    return [
        _of_model(name, in_mm=of in in_mm) if is_own else units.get(name, "")
        for is_own, of, name in zip(own.tolist(), p.object.tolist(), p.name.tolist())
    ]


def _of_model(name: str, *, in_mm: bool) -> str:
    """Unit of a parameter of a camera's own model."""
    if name in _BY_NAME or name in ("as", "q"):
        return _BY_NAME.get(name, "1")
    return _OF_BROWN[name] if in_mm else NORMALISED


def _units_of_set(name: str, solution: Solution) -> dict[str, str]:
    if name.partition(" ")[0] not in SETS:  # a user's: its parameters are lengths at the border
        return {str(n): "mm" for n, g in zip(solution.parameters.name, solution.parameters.group) if g == "additional"}
    chosen: ParameterSet = parameter_set(name)
    return dict(zip(chosen.parameters, chosen.units))
