"""Between any wanted force and the motor.

The safety chain, passivity control, the local virtual coupling, the lateral fixture.
"""
