"""How strongly the data speak for a cause: closed forms, noise integrated over, and what clean recordings show."""
