"""What has become faster where bodies pile up? In turn with an earlier commit."""
