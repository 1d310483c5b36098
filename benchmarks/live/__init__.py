"""How fast the live page is: real-time factor, and the time from the hand to the picture."""
