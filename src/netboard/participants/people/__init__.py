"""Simulated participants: perception, controller, and the hand that holds a stylus. Pure.

Open `controller.py` first: an intermittent, predictive, delayed PD controller. `senses` models its perception,
`observer` what the force tells it of its partner, `submovement` its actions, `hand` the arm, and `population` how
participants differ.
"""
