"""Which method keeps the levels together? Methods, interpolants and weights side by side."""
