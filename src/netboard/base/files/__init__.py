"""Files that a command reads and writes.

A file in `new` is complete or absent, `text` reads one in UTF-8, `figure` never overwrites a figure.
"""
