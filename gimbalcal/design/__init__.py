"""What a schedule can and cannot see, and the schedule that sees most."""
