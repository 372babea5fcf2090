"""A static run of a space-stable platform: Wu et al. (2018), section 5."""
