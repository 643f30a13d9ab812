"""CLEAR, identity, HOTA, OSPA and GOSPA: what tracks are measured by."""
