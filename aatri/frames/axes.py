"""Order of axes: from the order of a table to the right-handed east, north, up, and back.

Chinese geodetic tables give X north, Y east, H: a left-handed order, `north,east,up`. Reordering the columns makes
coordinates right-handed; covariances are reordered in rows and columns alike.
"""

from collections.abc import Sequence

from aatri.arrays import Float

_PLACE = {"east": 0, "north": 1, "up": 2, "x": 0, "y": 1, "z": 2, "longitude": 0, "latitude": 1, "height": 2}


def columns_in_order(axes: Sequence[str]) -> list[int]:
    """For east, north, up (x, y, z; longitude, latitude, height): which column of the table it is.

    Raises
    ------
    ValueError
        If the names are not three different axes of one system.

    Examples
    --------
    North before east, as geodetic tables have it:

    >>> columns_in_order(["north", "east", "up"])
    [1, 0, 2]
    """
    places = [_PLACE.get(name, -1) for name in axes]
    if sorted(places) != [0, 1, 2]:
        raise ValueError(f"{', '.join(axes)} are not three axes")
    return [places.index(k) for k in range(3)]


def in_right_handed_order(xyz: Float, axes: Sequence[str]) -> Float:
    """Coordinates (n, 3) or covariances (n, 3, 3) in the order of `axes` -> east, north, up."""
    order = columns_in_order(axes)
    return xyz[:, order] if xyz.ndim == 2 else xyz[:, order][:, :, order]


def in_order_of(xyz: Float, axes: Sequence[str]) -> Float:
    """Coordinates (n, 3) or covariances (n, 3, 3) in east, north, up -> the order of `axes`."""
    order = [_PLACE[name] for name in axes]
    return xyz[:, order] if xyz.ndim == 2 else xyz[:, order][:, :, order]
