"""What is said of data and results beside the adjustment: one file per cause, called by stages only."""
