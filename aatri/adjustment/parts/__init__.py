"""A problem adjusted in parts: how it is cut, what the parts share, and the parts together."""
