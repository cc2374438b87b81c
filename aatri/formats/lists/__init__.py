"""Lists of orientations, positions, control and image points: any columns, told by a header, a preset or the user."""
