"""What a process writes on the terminal: tables, progress, log lines, and commands to copy.

`output` makes consoles and tables, `bars` the bars of progress, `logs` the log lines of a loop, which must not wait for
a terminal, `shell` commands for the reader's own terminal.
"""
