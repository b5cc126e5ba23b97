"""What a participant sees: a pure scene, and the Qt window that draws it."""
