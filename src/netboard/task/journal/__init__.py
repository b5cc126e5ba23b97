"""The journal of a session: its entries, the progress they amount to, and whether it is that of the same session."""
