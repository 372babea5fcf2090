"""A unit's history: the store, and how calibrations compare."""
