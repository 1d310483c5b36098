"""What does each rule of the solver gain?"""
