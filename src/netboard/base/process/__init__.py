"""A process and its machine.

`stopping` ends it cleanly, `realtime` sets up a loop, `resources` has its memory, files and C library, and `workers`
work for it.
"""
