"""Both triads by navigation in place: a unit is turned through stops, and what its navigator does wrong tells why."""
