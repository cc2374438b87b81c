"""The page of `aatri measure`: points and fiducial marks measured in the images of a block folder, by a browser."""
