"""Layers for geographic information systems: GeoPackage with styles of QGIS, GeoJSON."""
