"""The commands of netboard: one file builds the parts of one process and runs its loop.

Open `cli` first: its table lists the commands. `bench` and `devices` are groups with a module per room or command.
Shared by all: `options` declares options, `loading` reads the files that they name, `guard` turns errors into exit codes.
"""
