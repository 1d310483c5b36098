"""Pictures, films and plots of stored runs. Nothing here knows a solver."""
