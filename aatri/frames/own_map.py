"""A map for coordinates in latitude, longitude and height: the UTM zone of their middle, on their datum.

On a sphere (planets, moons), where PROJ has no UTM, it is the transverse Mercator of the zone with the scale 1.
"""

from aatri.frames.conversion import Frame, crs_of
from aatri.frames.limits import SURE_CONFIDENCE


def utm_of(frame: Frame, latitude_deg: float, longitude_deg: float) -> Frame:
    """The map, east, north, up, with the heights of the geographic frame.

    Parameters
    ----------
    frame : Frame
        Geographic.
    latitude_deg, longitude_deg : float, degrees
        Where the block is.
    """
    from pyproj.crs import ProjectedCRS
    from pyproj.crs.coordinate_operation import TransverseMercatorConversion, UTMConversion

    zone = int((longitude_deg + 180.0) % 360.0 // 6.0) + 1
    half = "N" if latitude_deg >= 0 else "S"
    datum = crs_of(frame).geodetic_crs.to_2d()
    is_sphere = datum.ellipsoid.semi_major_metre == datum.ellipsoid.semi_minor_metre
    name = f"{datum.name} / transverse Mercator, zone {zone}" if is_sphere else f"{datum.name} / UTM zone {zone}{half}"
    conversion = (
        TransverseMercatorConversion(longitude_natural_origin=6 * zone - 183, false_easting=5e5)
        if is_sphere
        else UTMConversion(str(zone), half)
    )
    made = ProjectedCRS(conversion=conversion, name=name, geodetic_crs=datum)
    code = made.to_authority(min_confidence=SURE_CONFIDENCE)
    return Frame(
        f"utm{zone}{half.lower()}", ("east", "north", "up"), ":".join(code) if code else made.to_wkt(), frame.vertical
    )
