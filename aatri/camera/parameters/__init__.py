"""Additional parameters: sets of correction functions of the measured photo coordinates."""
