"""Interior orientation: from the Block to marks and transformations as arrays, and on to ImagePoints."""
