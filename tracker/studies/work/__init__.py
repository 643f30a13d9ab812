"""What a study has computed: jobs, where their recordings are, workers, and the cluster."""
