"""Is this machine fit for a session? Disk, network, timing, software, USB."""
