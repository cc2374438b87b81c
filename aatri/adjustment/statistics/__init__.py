"""What residuals and cofactors say: reliability, data snooping, significance, removal of parameters."""
