"""What participants are asked to do, and in which order: studies, and the plans that follow from them (pure)."""
