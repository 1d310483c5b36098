"""Which of IPC's classic scenes run, and how long do they take?"""
