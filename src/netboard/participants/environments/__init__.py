"""Environments for reinforcement learning: Gymnasium (one, or thousands at once) and PettingZoo (two agents). Pure.

`vector.py`, `single.py` and `parallel.py` wrap the scenes of `netboard.participants.batch`, which have the kernels. The
extra ``environments`` installs the libraries; they are imported only by the modules that need them. ``gymnasium.make``
finds ``netboard:netboard/Board-v1`` if Gymnasium was imported before netboard; `registration` registers it at any time.
"""
