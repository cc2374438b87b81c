"""A parameter set of the user's own: a Python text with `names` and `basis(x_mm, y_mm)`.

    names = ["s", "t"]
    def basis(x_mm, y_mm):                      # (n,) each, mm from the nominal principal point
        K = np.zeros((len(x_mm), 2, 2))         # (n, 2, s): per parameter what is added to x and to y
        ...
        return K

`np` is there. The correction is added to the measured coordinates, K times the parameters; K should be about 1 near the
border of the image, the parameters then are lengths in mm. Reading the file is up to the caller.
"""

import numpy as np

from aatri.arrays import Float
from aatri.camera.parameters.parameter_set import ParameterSet, SetScale, no_classical_values
from aatri.errors import PluginError

REMEDY = 'define names = ["s", ...] and basis(x_mm, y_mm) -> (n, 2, number of names), numbers in mm per parameter'


def user_set(text: str, where: str) -> ParameterSet:
    """Parameter set from the text of a plugin file.

    Parameters
    ----------
    text : str
        Python source. It is executed.
    where : str
        The file's path, for messages.

    Raises
    ------
    PluginError
        If the text is not Python, fails, or does not define what is asked for.
    """
    space: dict[str, object] = {"np": np, "__name__": "aatri_user_parameters", "__file__": where}
    try:
        exec(compile(text, where, "exec"), space)
    except SyntaxError as error:
        raise PluginError(
            f"not Python: {error.msg}", where=f"{where}:{error.lineno}:{error.offset}", remedy=REMEDY
        ) from error
    except Exception as error:
        raise PluginError(f"fails: {type(error).__name__}: {error}", where=where, remedy=REMEDY) from error
    names = _names(space.get("names"), where)
    function = space.get("basis")
    if not callable(function):
        raise PluginError("defines no function basis(x_mm, y_mm)", where=where, remedy=REMEDY)

    def basis(xy_mm: Float, _: SetScale) -> Float:
        try:
            columns = np.asarray(function(xy_mm[:, 0].copy(), xy_mm[:, 1].copy()), dtype=np.float64)
        except Exception as error:
            raise PluginError(f"basis fails: {type(error).__name__}: {error}", where=where, remedy=REMEDY) from error
        if columns.shape != (len(xy_mm), 2, len(names)):
            shape = (len(xy_mm), 2, len(names))
            raise PluginError(f"basis returns shape {columns.shape}, not {shape}", where=where, remedy=REMEDY)
        if not np.isfinite(columns).all():
            row = int(np.flatnonzero(~np.isfinite(columns).all(axis=(1, 2)))[0])
            point = f"({xy_mm[row, 0]:.3f}, {xy_mm[row, 1]:.3f}) mm"
            raise PluginError(f"basis is not finite at {point}", where=where, remedy=REMEDY)
        return columns

    count = len(names)
    return ParameterSet("user", names, ("mm",) * count, basis, no_classical_values(count))


def _names(listed: object, where: str) -> tuple[str, ...]:
    if not isinstance(listed, list | tuple) or not listed or not all(isinstance(name, str) and name for name in listed):
        raise PluginError(f"names is {listed!r}, not a list of texts", where=where, remedy=REMEDY)
    if len(set(listed)) < len(listed):
        raise PluginError(f"names has {max(listed, key=listed.count)!r} twice", where=where, remedy=REMEDY)
    return tuple(listed)
