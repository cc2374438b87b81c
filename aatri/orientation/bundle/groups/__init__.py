"""Observations that are wrong together: of a strip, a flight, a camera, an image, a neighbourhood."""
