"""Gyroscopes from rests, from the turns between them, and from whole revolutions."""
