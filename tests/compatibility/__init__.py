"""Files that earlier versions wrote, and what each must still open as."""
