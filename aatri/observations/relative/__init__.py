"""Relative control: conditions on points or projection centres, observed or exact; a file per shape."""
