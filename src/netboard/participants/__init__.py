"""Simulated participants: perception, controller, hand and device mechanics. Pure.

Open `controller.py` first: an intermittent, predictive, delayed PD controller. `senses` models its perception,
`submovement` its actions, `hand` the arm that holds a stylus, and `device_models` the haptic devices. This wing knows
no device driver, no network and no clock.
"""
