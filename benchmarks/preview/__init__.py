"""How right previews are: old and new defaults side by side, and the page that shows it."""
