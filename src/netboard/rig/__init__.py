"""Looking after the devices of a rig: which are there, whether they are well, what they are like, how they stand."""
