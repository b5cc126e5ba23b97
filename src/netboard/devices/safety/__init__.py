"""Safety between each requested force and the motor.

Contains the safety chain, passivity control, the local virtual coupling and the lateral fixture.
"""
