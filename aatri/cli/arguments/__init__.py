"""What the command line names: runs, plans, plugins; and what the shell completes of it."""
