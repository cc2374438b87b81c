"""Bad inputs, a folder each: `recipe.py` makes the input, `message.txt` is what aatri says of it, as approved."""
