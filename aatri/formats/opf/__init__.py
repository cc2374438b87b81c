"""OPF, Pix4D's open photogrammetry format."""
