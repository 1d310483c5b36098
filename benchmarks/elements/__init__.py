"""What do smoothed elements gain beside linear ones, and what do they cost?"""
