"""With what: every cause of the catalogue as columns, and the shapes that stand for "none of these"."""
