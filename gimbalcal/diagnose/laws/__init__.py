"""Laws outside the catalogue: which small formula of what was recorded explains a residual that no effect does."""
