"""BINGO: image coordinates, and geoin.dat with cameras and control."""
