"""Files that a command reads and writes.

A file in `new` is complete or absent, `text` reads one up to a largest size, `figure` never overwrites a figure.
"""
