"""A whole session on one machine or several: its programs, what it lacks, its processes and their logs.

`session.py` starts, watches and stops the processes of a session over its machines; open it first. `programs.py`
declares which commands there are, `preparation.py` finds what is missing and creates it, `kernels.py` compiles for
them, `machines.py` runs processes on this machine, and `terminal.py` is what ``netboard up`` prints. This room knows no
window.
"""
