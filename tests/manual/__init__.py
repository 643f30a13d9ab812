"""The manual: pages that are made from the code and from records, and tests that they hold."""
