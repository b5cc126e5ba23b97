"""The graphical user interfaces. The only wing that imports Qt.

Open `participant/scene.py` first: what can be drawn, pure. `participant` is the participant's display behind the
curtain, `operator` the console, `replay` the player of recordings, `monitor` the live view of a device. Modules without
Qt hold texts, lamps and layouts, so that they can be tested without a screen. This wing uses no physics and no
recording format.
"""
