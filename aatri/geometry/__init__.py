"""Rotations, rays, intersections, similarities."""
