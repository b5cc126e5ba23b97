"""A recording on the sockets of a server, or told as text."""
