"""Interior orientation of film: fiducials, their numbering, the deformation they leave open."""
