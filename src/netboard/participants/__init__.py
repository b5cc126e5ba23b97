"""Simulated participants: perception, controller, hand and device mechanics. Pure.

Open `controller.py` first: an intermittent, predictive, delayed PD controller. `senses` is what it perceives,
`submovement` how it acts, `hand` the arm that holds a stylus, `device_models` the haptic devices as numbers. This
wing knows no device driver, no network and no clock.
"""
