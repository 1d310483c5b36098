"""How fast is a step beside STARK's? Both run in turn on one machine."""
