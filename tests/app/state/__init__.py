"""What the workbench keeps and who works on it."""
