"""Runs that no one waits for: thousands of scenes side by side, and methods that know what comes next."""
