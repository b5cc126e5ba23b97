"""How the windows look: pictures of each state at each size and theme, and whether all text and keys are there."""
