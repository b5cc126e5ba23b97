"""What POSIX and Windows do in different ways: one module a task, with both implementations, chosen once.

`windows` declares the functions of Windows, `locks` locks files, `monotonic` reads the clock, `supervision` starts and
ends processes together, `scheduling` sets up a thread and memory for real time, `keys` reads a terminal, `serial_line`
opens a serial port, and `ownership` keeps files from other users. Kernels have the same in
`netboard.network.transport`: `waiting` and `libzmq`, and `local_endpoints` for sockets of one machine.

Elsewhere nothing imports a module, or names a function, that only POSIX has; a test checks that. The implementations
for Windows have run here with a stand-in for its libraries only, see docs/decisions/0049-windows.md.
"""
