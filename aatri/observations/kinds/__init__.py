"""The list of the kinds of observation there are, with their options: the only place that knows them all."""
