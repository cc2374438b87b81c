"""Long campaigns, run by hand: the count is the argument."""
