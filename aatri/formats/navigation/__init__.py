"""Positions as receivers and cameras give them: DJI's MRK, what is written in photographs (EXIF, XMP)."""
