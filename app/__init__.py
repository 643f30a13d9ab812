"""The local web workbench around the engine, and the command line."""
