"""Corrections of image coordinates by the atmosphere and the figure of the earth."""
