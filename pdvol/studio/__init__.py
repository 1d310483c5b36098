"""The studio: tools around the method, which read what it stores. The core imports nothing of it."""
