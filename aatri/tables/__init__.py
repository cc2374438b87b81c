"""Typed columns <-> HDF5, with units, digests and integrity; knows no photogrammetry."""
