"""Tables and figures, made from the files of jobs and nothing else."""
