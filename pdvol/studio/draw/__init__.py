"""Pictures, films and plots of stored runs. Nothing here imports a solver."""
