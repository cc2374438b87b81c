"""Between artifacts and arrays: what a method takes out of a Block, and the tables its result becomes."""
