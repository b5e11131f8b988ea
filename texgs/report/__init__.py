"""Tables and figures, made from the metrics files of jobs and nothing else."""
