"""aatri: analytical aerial triangulation as a pipeline of swappable stages."""

__version__ = "0.1.0"
