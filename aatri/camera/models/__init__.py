"""Camera models: distortion as a correction of the measurement, forward models, their inversion."""
