"""``netboard bench coupling``: over what delay a hand can be coupled to the board, and what may be done about it."""
