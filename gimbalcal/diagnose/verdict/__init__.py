"""What is claimed: decision, fit with what was found, held-out checks, where it is off, what would tell more."""
