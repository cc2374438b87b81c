"""Lists of positions as receivers give them: DJI's MRK."""
