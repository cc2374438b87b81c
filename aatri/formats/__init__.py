"""Files <-> Block and Solution."""
