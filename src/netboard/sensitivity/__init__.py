"""How far each open question of the paper, noise and lost samples move the reported numbers."""
