"""Strips as bodies: joined to components, oriented by control, corrected by polynomials."""
