"""Trigger boxes: hardware that turns events of a session into TTL pulses for EEG, EMG, eye trackers and video.

Start with `box.py`: open, write a code, read input pulses, close. `registry.py` finds the box of ``[triggers] kind``;
other packages add theirs to the entry-point group ``netboard.triggers``. When pulses begin and end is decided by
`pulses.py`, which has no clock. `netboard.nodes.trigger` runs a box in a session.
"""
