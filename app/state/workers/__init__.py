"""What goes on in the background: runs, compilation, figures, exports, the library."""
