"""What do MPI ranks gain?"""
