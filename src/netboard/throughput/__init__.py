"""What it costs to analyse a study: time, memory, and how both grow with the study."""
