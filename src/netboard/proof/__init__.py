"""What a recording proves of itself: whole or not, each tick computed again, each record accounted for."""
