"""Messages between processes, and their transport.

Open `protocol/PROTOCOL.md` first. `protocol` is pure: messages, their bytes, the rules of admission, the record
buffer. `transport` has every ZeroMQ socket, the compiled path of the 1 kHz frames, and authentication by CURVE keys;
only it imports zmq. `keys` makes and reads key files. This wing is independent of sessions, devices and recordings.
"""
