"""Sockets, endpoints, pollers and authentication: the only package that imports zmq."""
