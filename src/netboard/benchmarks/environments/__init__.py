"""Speed of the environments for reinforcement learning, beside Gymnasium's own CartPole. Open `bench.py`."""
