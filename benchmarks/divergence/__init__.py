"""How far do the levels of a shot drift apart?"""
