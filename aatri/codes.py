"""Codes in the tables of a Block: small integers with a name."""

NO_ROLE, CONTROL, CHECK, APPROXIMATE = 0, 1, 2, 3
"""Role of one coordinate of a ground point."""

WORDS_OF_ROLES = {NO_ROLE: "", CONTROL: "control", CHECK: "check", APPROXIMATE: "approximate"}

APPROXIMATE_VALUE, OBSERVED_VALUE = 0, 1
"""Use of an exterior position or attitude."""

WORDS_OF_USES = {APPROXIMATE_VALUE: "approximate", OBSERVED_VALUE: "observed"}

PROJECTION_CENTRE, ANTENNA = 0, 1
"""What an exterior position refers to."""

WORDS_OF_PLACES = {PROJECTION_CENTRE: "projection_centre", ANTENNA: "antenna"}
