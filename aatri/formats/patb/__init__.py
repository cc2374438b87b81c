"""PATB: orientations (.ori)."""
