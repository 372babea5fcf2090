"""Telescopes and antennas: the terms of a mount from stars, and how they differ from night to night."""
