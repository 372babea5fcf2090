"""Which combination: singles, pairs and thirds, constants refined, and what could stand in a cause's place."""
