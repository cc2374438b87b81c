"""Every compiled function of the package."""
