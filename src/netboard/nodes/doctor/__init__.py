"""Checks whether this machine is fit for a session: disk, network, timing, software, USB."""
