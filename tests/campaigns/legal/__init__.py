"""Small legal blocks of many kinds: flown by formulas of their own, adjusted by a dense network of its own."""
