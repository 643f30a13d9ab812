"""The sheet that opens recordings, as HTML: the page puts it in and draws what is drawn."""
