"""Does contact converge to Hertz' solution in cell size and contact distance?"""
