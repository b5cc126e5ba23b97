"""The commands of netboard: one file builds the parts of one process and runs its loop.

Open `cli` first: its table lists the commands. `bench` and `devices` are groups with a module per room or command.
All share `options` (declared options), `loading` (reads the files that options name) and `guard` (errors, exit codes).
"""
