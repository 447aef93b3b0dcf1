"""What is suspect in a log, told before anything is learned from it."""
