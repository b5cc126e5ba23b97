"""Sockets, endpoints, polling and authentication: the only place that imports zmq."""
