"""Bundle block adjustment: start values, the adjustment, bad starts, free datum, re-admission."""
