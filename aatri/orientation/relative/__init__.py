"""Relative orientation of image pairs."""
