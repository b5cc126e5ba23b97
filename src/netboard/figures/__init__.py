"""Pictures of a study, for the screen, for print and for people who do not see all colours."""
