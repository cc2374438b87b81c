"""MicMac's XML, of its first version and of MMVII: cameras, orientations, measured points, ground points."""
