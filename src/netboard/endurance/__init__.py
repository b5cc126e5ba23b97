"""``netboard bench stability``: where the methods hold, and where they fail."""
