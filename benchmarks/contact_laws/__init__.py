"""How do the three contact laws compare at rest and in impacts?"""
