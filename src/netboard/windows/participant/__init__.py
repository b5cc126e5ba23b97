"""The participant's display: a pure scene, and the Qt window that draws it."""
