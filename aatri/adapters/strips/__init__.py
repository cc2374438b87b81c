"""Models and strips as arrays, joined, adjusted, and as tables again."""
