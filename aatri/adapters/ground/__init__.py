"""Strips and images to the ground: control and positions as arrays, components as a Solution."""
