"""WuCAPS files: reader."""
