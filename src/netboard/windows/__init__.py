"""What people look at while an experiment runs. The only wing that imports Qt.

Open `participant/scene.py` first: what can be drawn, pure. `participant` is the display behind the curtain,
`operator` the console, `replay` the player of recordings, `monitor` a device live. Modules without Qt hold the words,
lamps and layouts, so that they can be tested without a screen. This wing knows no physics and no recording format.
"""
