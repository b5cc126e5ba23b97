"""Haptic devices behind one interface, and the safety chain next to the motor.

Open `contract/device.py` first: open, read, write, close. `safety` stands between any wanted force and the motor. A
backend is a room or module of its own: `touch` (OpenHaptics), `falcon`, `spacemouse`, `mouse`, `simulated`;
`contract/registry.py` finds it by its name. `setup` calibrates, identifies and checks devices. This wing knows no
server and no socket.
"""
