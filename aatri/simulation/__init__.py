"""Made-up blocks: the physical forward model, independent of every correction."""
