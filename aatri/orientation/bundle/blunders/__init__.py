"""The search for gross errors in a bundle: over all kinds of observations, at observations, points, images, control."""
