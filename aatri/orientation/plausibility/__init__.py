"""What cannot be right, found before adjusting: control off the block, cameras with impossible figures."""
