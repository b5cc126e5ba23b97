"""The closed loop of a block: policies behind the curtain, hands on their devices, and the stage. Pure.

Open `block.py`: one block, tick by tick. `closed_loop` is a participant behind the curtain, and `body` a hand on its
device.
"""
