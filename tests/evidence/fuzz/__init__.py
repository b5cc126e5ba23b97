"""Files and frames that are well formed and lie, and what the commands and the codec make of them."""
