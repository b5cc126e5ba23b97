"""The player of recordings, with its time line."""
