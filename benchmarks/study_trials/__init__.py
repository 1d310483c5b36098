"""Do a study's predictions hold? Random shots against finer references."""
