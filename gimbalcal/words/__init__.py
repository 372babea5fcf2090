"""Generate what a person reads: names, numbers and units as printed, and sentences on fits, findings and laws."""
