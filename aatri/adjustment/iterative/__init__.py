"""Conjugate gradients with a preconditioner of fronts, where a factor would be too large."""
