"""What observations leave open: rank, datum, weakness."""
