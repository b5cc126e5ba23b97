"""Many scenes at once, with agents at their seats: the kernels behind the environments. Pure, without their libraries.

Open `scenes.py`: it resets, steps and observes scenes at full fidelity, which verify to the bit; `reduced.py` does the
same at reduced fidelity, faster. `spaces.py` declares actions, observations, reward and options, and `agents.py` which
blocks are simulated. This room writes no file: an episode is handed over as rows.
"""
