"""What is fresh and what is stale, and why: a pure function of specification and store."""
