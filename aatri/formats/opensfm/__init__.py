"""OpenSfM and OpenDroneMap: reconstructions, tracks, ground control, lists of control and of positions."""
