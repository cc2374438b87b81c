"""Codes in the tables of a Block: small integers with a name."""

NO_ROLE, CONTROL, CHECK, APPROXIMATE = 0, 1, 2, 3
"""Role of one coordinate of a ground point."""

APPROXIMATE_VALUE, OBSERVED_VALUE = 0, 1
"""Use of an exterior position or attitude."""

PROJECTION_CENTRE, ANTENNA = 0, 1
"""What an exterior position refers to."""
