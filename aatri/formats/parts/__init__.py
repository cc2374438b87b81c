"""What files of other programs give of a block, and how it is put together."""
