"""Pages and pictures of any run, also of a failed one."""
