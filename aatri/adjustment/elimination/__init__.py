"""Normalise while eliminating: fronts, panels, the sharing out of work, back substitution."""
