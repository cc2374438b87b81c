"""A Block and start values as input of the bundle; its result, parameters and calibrations as tables."""
