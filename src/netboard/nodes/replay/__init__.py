"""Replay of a recording on the sockets of a server, or as text."""
