"""Speed of the environments for reinforcement learning, and how far reduced fidelity differs. Open `bench.py`."""
