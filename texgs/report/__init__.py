"""Tables and figures, made only from the files of jobs."""
