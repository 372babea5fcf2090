"""Generate what a person reads as text: names, numbers, formulas and units as printed, and sentences on all results."""
