"""How far can each number be pushed? The stability envelope."""
