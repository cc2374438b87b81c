"""Blocks as wholes: several merged to one by their ids, a part of one cut out."""
