"""Pairs of images as arrays: their rays, relative orientations, models and notes."""
