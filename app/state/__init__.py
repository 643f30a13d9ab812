"""What the workbench knows: the open recording, its runs, and whoever works on them."""
