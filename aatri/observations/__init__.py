"""One file per observation type: residuals and Jacobians."""
