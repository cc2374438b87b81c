"""The methods of orientation, arrays in and out."""
