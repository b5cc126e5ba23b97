"""The device interface, the backend registry, USB ids, device profiles and velocity estimators."""
