"""Which step and which delay a scene stands, and the method chosen from that."""
