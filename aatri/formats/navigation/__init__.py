"""Lists of positions and attitudes as receivers and inertial systems give them: DJI's MRK, Applanix' EO text."""
