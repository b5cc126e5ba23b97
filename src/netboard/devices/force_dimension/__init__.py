"""Backend ``force_dimension``: omega, delta, sigma and lambda devices through the vendor's haptic SDK."""
