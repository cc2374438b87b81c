"""Lists of the French mapping agency IGN: image points, ground points, cameras."""
