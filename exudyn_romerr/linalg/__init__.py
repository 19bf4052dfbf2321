"""Linear algebra and closed forms: nothing here knows a body."""
