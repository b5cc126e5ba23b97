"""Environments for reinforcement learning: Gymnasium (one, or thousands at once) and PettingZoo (two agents). Pure.

Open `scenes.py`: many scenes in one kernel, which the environments `vector.py`, `single.py` and `parallel.py` wrap.
`spaces.py` declares actions, observations, reward and options. The extra ``environments`` installs the libraries; they
are imported only by the modules that need them. ``gymnasium.make`` finds ``netboard:netboard/Board-v1`` if Gymnasium
was imported before netboard; `registration` registers it at any time. This room writes no file: an episode is handed
over as rows, for `netboard.recording.files.offline_writer`.
"""
