"""What participants are asked to do: blocks of trials and the trial machine (pure)."""
