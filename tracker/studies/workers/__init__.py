"""The computation of a study's runs: jobs, recordings on workers, workers, and the cluster."""
