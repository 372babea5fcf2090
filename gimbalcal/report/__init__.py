"""Render results for a person: a self-contained page for each, with its pictures, and the tables of the console."""
