"""What several studies share: processes, trials, tables, and the files of an earlier commit."""
