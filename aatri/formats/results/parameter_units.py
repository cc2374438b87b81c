"""Units of the parameters in a Solution, for headers and reports."""

from aatri.artifacts.solution import Solution
from aatri.camera.parameters.catalogue import SETS, parameter_set
from aatri.camera.parameters.parameter_set import ParameterSet

_BY_NAME = {
    **dict.fromkeys(("principal_distance", "principal_point.x", "principal_point.y", "c", "x0", "y0"), "mm"),
    **dict.fromkeys(("film correction d0", "film correction d3"), "mm"),
    **dict.fromkeys((f"film correction d{k}" for k in (1, 2, 4, 5)), "1"),
    **dict.fromkeys(("film correction d6", "film correction d7"), "1/mm"),
    **dict.fromkeys(("lever x", "lever y", "lever z", "shift X", "shift Y", "shift Z"), "m"),
    **dict.fromkeys(("drift X", "drift Y", "drift Z"), "m/s (m/image without times)"),
    **dict.fromkeys(("vx", "vy", "vz"), "m/s"),
    "time offset": "s",
    "tau_m": "m",
    "orientation": "rad",
    **{f"boresight {axis}": "rad" for axis in "xyz"},
    **{f"mount {axis}": "m" for axis in "XYZ"},
    **{f"mount turn about {axis}": "rad" for axis in "xyz"},
    **{f"shift {angle}": "rad" for angle in ("omega", "phi", "kappa", "roll", "pitch", "heading")},
}


def parameter_units(solution: Solution) -> list[str]:
    """Unit of each row of the parameters; empty where it depends on what the Solution does not tell."""
    known = dict(_BY_NAME)
    sets = solution.calibrated_sets
    for name in set() if sets is None else set(sets.set.tolist()):
        known |= _units_of_set(str(name), solution)
    return [known.get(str(name), "") for name in solution.parameters.name]


def _units_of_set(name: str, solution: Solution) -> dict[str, str]:
    if name.partition(" ")[0] not in SETS:  # a user's: its parameters are lengths at the border
        return {str(n): "mm" for n, g in zip(solution.parameters.name, solution.parameters.group) if g == "additional"}
    chosen: ParameterSet = parameter_set(name)
    return dict(zip(chosen.parameters, chosen.units))
