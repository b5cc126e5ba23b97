"""Counterfactual replay: recorded hand movements with another board, model or force condition."""
