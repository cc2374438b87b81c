"""What adjustments of any observations share: bodies tied to each other and to what is observed of the ground."""
