"""Image refinement: heights, tilts and lenses, as far as the Block tells them."""
