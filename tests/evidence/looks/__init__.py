"""How the windows look: Screenshots of each state at each size and theme, and whether all text and keys are there."""
