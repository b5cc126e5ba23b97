"""Messages, their bytes, and the rules of a connection. Pure."""
