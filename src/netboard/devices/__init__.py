"""Device wing: haptic devices behind one interface, and the safety chain next to the motor.

Start with `contract/device.py`: open, read, write, close. `safety` stands between every wanted force and the motor.
Each backend is a package or module: `touch` (OpenHaptics), `falcon`, `force_dimension`, `haply`, `spacemouse`, `mouse`,
`simulated`; `contract/registry.py` finds a backend by name. `servo` has what the servo threads in C share. `setup`
calibrates, identifies and checks devices. This wing uses no server and no sockets of netboard's.
"""
