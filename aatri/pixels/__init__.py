"""Work on the pixels of images: windows, features, matches, tracks. The centre of the first pixel is (0, 0)."""
