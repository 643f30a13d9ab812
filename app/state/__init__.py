"""The state of the workbench: the open recording, its runs, and the jobs that compute them."""
